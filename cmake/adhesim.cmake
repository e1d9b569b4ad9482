# One place for compiler settings and for how libraries and tests are declared.

add_library(adhesim_options INTERFACE)
target_include_directories(adhesim_options INTERFACE ${PROJECT_SOURCE_DIR})
# Same bits on every machine: no contraction into fused multiply-adds, no fast-math, no -march.
target_compile_options(adhesim_options INTERFACE -Wall -Wextra -Wno-unused-parameter -ffp-contract=off)
if(ADHESIM_SANITIZE)
  target_compile_options(adhesim_options INTERFACE -fsanitize=${ADHESIM_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(adhesim_options INTERFACE -fsanitize=${ADHESIM_SANITIZE})
endif()

find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
endif()

# adhesim_library(NAME SOURCES file... DEPS target...)
function(adhesim_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;DEPS" ${ARGN})
  if(arg_SOURCES)
    add_library(${name} STATIC ${arg_SOURCES})
    target_link_libraries(${name} PUBLIC adhesim_options ${arg_DEPS})
  else()
    add_library(${name} INTERFACE)
    target_link_libraries(${name} INTERFACE adhesim_options ${arg_DEPS})
  endif()
endfunction()

# adhesim_test(NAME SOURCES file... DEPS target...): one GoogleTest program, each TEST known to ctest by its name.
function(adhesim_test name)
  cmake_parse_arguments(arg "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE adhesim_options ${arg_DEPS} GTest::gtest GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE ADHESIM_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  include(GoogleTest)
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
endfunction()
