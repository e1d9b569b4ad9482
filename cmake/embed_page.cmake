# cmake -D PAGE_DIR=folder -D OUT=file.cc -P embed_page.cmake: writes a source that holds every file of the folder and defines
# PageFiles(). The assembler reads the bytes (.incbin): half a megabyte as a C++ array would take the compiler seconds.

cmake_minimum_required(VERSION 3.25)

set(type_html "text/html; charset=utf-8")
set(type_js "text/javascript; charset=utf-8")
set(type_css "text/css; charset=utf-8")
set(type_json "application/json")
set(type_svg "image/svg+xml")
set(type_png "image/png")
set(type_ico "image/x-icon")
set(type_woff2 "font/woff2")
set(type_wasm "application/wasm")
set(type_txt "text/plain; charset=utf-8")

file(GLOB_RECURSE names RELATIVE ${PAGE_DIR} ${PAGE_DIR}/*)
if(NOT "index.html" IN_LIST names)
  message(FATAL_ERROR "${PAGE_DIR} holds no index.html: the page's build went wrong")
endif()
list(SORT names)

set(blobs "")
set(symbols "")
set(table "")
set(index 0)
foreach(name ${names})
  string(REGEX REPLACE ".*\\." "" extension "${name}")
  set(type "${type_${extension}}")
  if(NOT type)
    set(type "application/octet-stream")
  endif()
  file(SHA256 ${PAGE_DIR}/${name} hash)
  string(SUBSTRING ${hash} 0 16 hash)
  file(SIZE ${PAGE_DIR}/${name} size)
  string(APPEND blobs "asm(\".pushsection .rodata\\nadhesim_page_${index}:\\n.incbin \\\"${PAGE_DIR}/${name}\\\"\\n.popsection\");  // ${hash}\n")
  string(APPEND symbols "extern \"C\" const char adhesim_page_${index}[];\n")
  string(APPEND table "    {\"/${name}\", \"${type}\", {adhesim_page_${index}, ${size}}, \"\\\"${hash}\\\"\"},\n")
  math(EXPR index "${index} + 1")
endforeach()

file(WRITE ${OUT} "// Generated from the page's build.
#include \"server/web/page_files.h\"

${blobs}
${symbols}
namespace adhesim {
namespace {

constexpr PageFile kFiles[] = {
${table}};

}  // namespace

std::span<const PageFile> PageFiles() { return kFiles; }

}  // namespace adhesim
")
