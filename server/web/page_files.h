#pragma once

#include <span>
#include <string_view>

namespace adhesim {

// A file of the page, held by the program.
struct PageFile {
  std::string_view path;          // begins with "/": "/index.html"
  std::string_view content_type;  // "text/html; charset=utf-8"
  std::string_view bytes;
  std::string_view etag;  // a quoted hash of the bytes
};

// All files of the page; "/index.html" is among them.
std::span<const PageFile> PageFiles();

}  // namespace adhesim
