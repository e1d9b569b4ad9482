#include "clients/cli/page_server.h"

#include <absl/strings/str_cat.h>

#include <utility>

#include "server/errors.h"
#include "server/limits.h"
#include "server/recording_source.h"
#include "server/scene_source.h"
#include "server/service_context.h"
#include "server/session_calls.h"
#include "server/sessions.h"
#include "server/web/page_files.h"
#include "server/web/web_server.h"

namespace adhesim {

namespace {

// The name under which the page finds the recording.
constexpr char kName[] = "recording.mcap";

RecordingSource Only(const std::string& path) {
  RecordingSource source;
  source.find = [path](const std::string& name) -> absl::StatusOr<std::string> {
    if (name == kName) return path;
    return Error(Reason::kRecordingNotFound, "there is one recording here");
  };
  return source;
}

}  // namespace

// In the order of construction; destroyed the other way round.
struct PageServer::Parts {
  explicit Parts(const std::string& recording)
      : sessions(SceneSource(), Limits(), /*realtime=*/false, Only(recording)) {}

  Sessions sessions;
  ServiceContext context{sessions, {}};
  SessionCalls calls{&context, {}};
  std::unique_ptr<WebServer> web;
};

absl::Status PageServer::HasPage() {
  // Without the page there is one file, which says so.
  if (PageFiles().size() > 1) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "this program was built without its page, which draws the pictures");
}

absl::StatusOr<std::unique_ptr<PageServer>> PageServer::Start(const std::string& recording) {
  auto parts = std::make_unique<Parts>(recording);
  WebServer::Options options;
  options.listen = "127.0.0.1:0";
  absl::StatusOr<std::unique_ptr<WebServer>> web =
      WebServer::Start(options, &parts->context, &parts->calls);
  if (!web.ok()) return web.status();
  parts->web = *std::move(web);
  return std::unique_ptr<PageServer>(new PageServer(std::move(parts)));
}

PageServer::PageServer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
PageServer::~PageServer() = default;

std::string PageServer::url() const {
  return absl::StrCat("http://", parts_->web->address(), "/?recording=/v1/recordings/", kName);
}

}  // namespace adhesim
