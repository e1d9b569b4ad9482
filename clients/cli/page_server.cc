#include "clients/cli/page_server.h"

#include <utility>

#include "server/limits.h"
#include "server/scene_source.h"
#include "server/service_context.h"
#include "server/session_calls.h"
#include "server/sessions.h"
#include "server/web/page_files.h"
#include "server/web/web_server.h"

namespace adhesim {

// In the order of construction; destroyed the other way round.
struct PageServer::Parts {
  Sessions sessions{SceneSource(), Limits(), /*realtime=*/false};
  ServiceContext context{sessions, {}};
  SessionCalls calls{&context, {}, nullptr};
  std::unique_ptr<WebServer> web;
};

absl::Status PageServer::HasPage() {
  // Without the page there is one file, which says so.
  if (PageFiles().size() > 1) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "this program was built without its page, which draws the pictures");
}

absl::StatusOr<std::unique_ptr<PageServer>> PageServer::Start(const std::string& recordings) {
  auto parts = std::make_unique<Parts>();
  WebServer::Options options;
  options.listen = "127.0.0.1:0";
  options.recordings = recordings;
  absl::StatusOr<std::unique_ptr<WebServer>> web =
      WebServer::Start(options, &parts->context, &parts->calls);
  if (!web.ok()) return web.status();
  parts->web = *std::move(web);
  return std::unique_ptr<PageServer>(new PageServer(std::move(parts)));
}

PageServer::PageServer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
PageServer::~PageServer() = default;

const std::string& PageServer::address() const { return parts_->web->address(); }

}  // namespace adhesim
