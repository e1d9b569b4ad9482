#include "server/web/page_files.h"

namespace adhesim {

std::span<const PageFile> PageFiles() {
  static constexpr PageFile kFiles[] = {
      {"/index.html", "text/html; charset=utf-8",
       "<!doctype html><title>adhesim</title><p>This server was built without its page.", "\"none\""}};
  return kFiles;
}

}  // namespace adhesim
