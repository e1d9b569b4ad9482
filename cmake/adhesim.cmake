# One place for compiler settings and for how libraries and tests are declared.

add_library(adhesim_options INTERFACE)
target_include_directories(adhesim_options INTERFACE ${PROJECT_SOURCE_DIR})
# Same bits on every machine: no contraction into fused multiply-adds, no fast-math, no -march.
target_compile_options(adhesim_options INTERFACE -Wall -Wextra -Wno-unused-parameter -ffp-contract=off)
if(ADHESIM_SANITIZE)
  # A finding ends the test, so that it cannot pass unread. The standard library checks its own indices, too. Left out is
  # what the address sanitizer finds by the access itself and what only casts between classes could do wrong: they are
  # a third of the time it takes to compile. With sanitizers g++ takes much for uninitialised that is not.
  target_compile_options(adhesim_options INTERFACE -fsanitize=${ADHESIM_SANITIZE} -fno-sanitize-recover=all
                         -fno-sanitize=null,object-size,pointer-overflow,vptr -fno-omit-frame-pointer
                         -Wno-maybe-uninitialized)
  target_compile_definitions(adhesim_options INTERFACE _GLIBCXX_ASSERTIONS)
  target_link_options(adhesim_options INTERFACE -fsanitize=${ADHESIM_SANITIZE})
endif()

# Undefined behaviour is looked for in what is tested: without that, the tests' own sources compile in two thirds of the time.
add_library(adhesim_test_options INTERFACE)
target_link_libraries(adhesim_test_options INTERFACE adhesim_options)
if(ADHESIM_SANITIZE)
  target_compile_options(adhesim_test_options INTERFACE -fno-sanitize=undefined)
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

# Everything that ctest needs, and no more: sanitizer builds compile only this.
add_custom_target(adhesim_tests)

# adhesim_test(NAME SOURCES file... DEPS target... [LABELS label...]): one GoogleTest program, each TEST known to ctest by
# its name (behind the name of the build, when that has sanitizers). Label what uses threads "threads": the thread
# sanitizer sees those tests, and no others.
function(adhesim_test name)
  cmake_parse_arguments(arg "" "" "SOURCES;DEPS;LABELS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_DEPS} adhesim_test_options GTest::gtest GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE ADHESIM_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  set(prefix "")
  set(environment "")
  if(ADHESIM_SANITIZE STREQUAL "thread")
    if(NOT "threads" IN_LIST arg_LABELS)
      set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
      return()
    endif()
    set(prefix "tsan:")
    set(environment "TSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/tests/tsan_suppressions.txt")
  elseif(ADHESIM_SANITIZE)
    set(prefix "asan-ubsan:")
  endif()
  add_dependencies(adhesim_tests ${name})
  include(GoogleTest)
  gtest_discover_tests(${name} TEST_PREFIX "${prefix}" DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS "${arg_LABELS}" ENVIRONMENT "${environment}")
endfunction()
