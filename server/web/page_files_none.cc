#include "server/web/page_files.h"

namespace adhesim {
namespace {

constexpr PageFile kFiles[] = {
    {"/index.html", "text/html; charset=utf-8",
     "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>adhesim</title>"
     "<p>This server was built without the viewer's page; its WebSocket is at /v1/ws.</p></html>\n",
     "\"none\""},
};

}  // namespace

std::span<const PageFile> PageFiles() { return kFiles; }

}  // namespace adhesim
