# The page in the server: built by Node from clients/web, its files laid into the program.

option(ADHESIM_WEB "Build the page and put it into the server (needs Node and the npm packages that ./dev setup installs)" ON)

set(ADHESIM_PAGE_DIR ${PROJECT_SOURCE_DIR}/build/web/dist)  # Vite's output, the same for all presets

# Sets `out` to why the page cannot be built here; empty when it can.
function(adhesim_page_obstacle out)
  set(obstacle "")
  find_program(ADHESIM_NODE node)
  find_program(ADHESIM_NPM npm)
  if(NOT ADHESIM_WEB)
    set(obstacle "ADHESIM_WEB is OFF")
  elseif(NOT ADHESIM_NODE OR NOT ADHESIM_NPM)
    set(obstacle "there is no Node with npm on PATH")
  elseif(NOT EXISTS ${PROJECT_SOURCE_DIR}/clients/web/node_modules/.installed)
    set(obstacle "the npm packages of clients/web are not installed")
  endif()
  set(${out} "${obstacle}" PARENT_SCOPE)
endfunction()

# adhesim_page_source(OUT FALLBACK): sets OUT to the source that defines PageFiles() (server/web/page_files.h): generated from
# the page, or FALLBACK where it cannot be built. ADHESIM_PAGE_BUILT tells which, to the whole project.
function(adhesim_page_source out fallback)
  adhesim_page_obstacle(obstacle)
  set(ADHESIM_PAGE_BUILT OFF CACHE INTERNAL "The server has the page")
  if(obstacle)
    if(ADHESIM_WEB)
      message(WARNING "The server is built without its page: ${obstacle}. ./dev build installs what is missing.")
    endif()
    set(${out} ${fallback} PARENT_SCOPE)
    return()
  endif()
  set(ADHESIM_PAGE_BUILT ON CACHE INTERNAL "The server has the page")

  set(web ${PROJECT_SOURCE_DIR}/clients/web)
  file(GLOB_RECURSE inputs CONFIGURE_DEPENDS ${web}/src/* ${web}/public/* ${PROJECT_SOURCE_DIR}/proto/*.proto)
  file(GLOB settings CONFIGURE_DEPENDS ${web}/*.html ${web}/*.json ${web}/*.ts ${web}/*.js ${web}/*.mjs)
  add_custom_command(
    OUTPUT ${ADHESIM_PAGE_DIR}/index.html
    COMMAND ${ADHESIM_NPM} run --silent build
    COMMAND ${CMAKE_COMMAND} -E touch ${ADHESIM_PAGE_DIR}/index.html
    WORKING_DIRECTORY ${web}
    DEPENDS ${inputs} ${settings}
    COMMENT "Building the page" VERBATIM)
  set(source ${PROJECT_BINARY_DIR}/web/page_files.cc)
  add_custom_command(
    OUTPUT ${source}
    COMMAND ${CMAKE_COMMAND} -D PAGE_DIR=${ADHESIM_PAGE_DIR} -D OUT=${source} -P ${PROJECT_SOURCE_DIR}/cmake/embed_page.cmake
    DEPENDS ${ADHESIM_PAGE_DIR}/index.html ${PROJECT_SOURCE_DIR}/cmake/embed_page.cmake
    COMMENT "Laying the page into the program" VERBATIM)
  set(${out} ${source} PARENT_SCOPE)
endfunction()
