#pragma once

#include <span>
#include <string_view>

namespace adhesim {

// A file of the viewer's page, as it is built into the program.
struct PageFile {
  std::string_view path;  // "/index.html", "/assets/x.js"
  std::string_view content_type;
  std::string_view bytes;
  std::string_view etag;  // with its quotation marks; changes when the bytes do
};

// All of them; "/index.html" is always there.
std::span<const PageFile> PageFiles();

}  // namespace adhesim
