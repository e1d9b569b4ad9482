#include "server/server.h"

#include <absl/strings/str_cat.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <thread>
#include <utility>

#include "server/errors.h"
#include "server/interaction_service.h"
#include "server/recording_service.h"
#include "server/service_context.h"
#include "server/session_service.h"
#include "server/view_service.h"
#include "server/web/web_server.h"

namespace adhesim {
namespace {

constexpr int kKeepaliveMs = 10'000;        // a client that froze is noticed after this
constexpr int kKeepaliveTimeoutMs = 5'000;  // and this
constexpr int kShortestPingMs =
    5'000;  // clients may ping as often; the default (5 min) would drop them
constexpr int kIdleMs = 5 * 60'000;  // connections without calls
constexpr int kStreamsPerConnection = 100;
constexpr auto kCancelAfter = std::chrono::seconds(1);

std::once_flag plugins_once;

// Both apply to the process; they must come before the first ServerBuilder.
void EnablePlugins() {
  std::call_once(plugins_once, [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
}

void Configure(const Limits& limits, grpc::ServerBuilder* builder) {
  builder->SetMaxReceiveMessageSize(limits.request_bytes);
  builder->SetMaxSendMessageSize(-1);  // frames are bounded by Limits::particles
  // gRPC shares ports by default: a second server on a taken one would start, and get half of the
  // calls.
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                              kShortestPingMs);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, kIdleMs);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kStreamsPerConnection);
}

}  // namespace

// In the order of construction; destroyed the other way round.
struct Server::Parts {
  Parts(const Options& options, SceneSource scenes, SessionCalls::About about)
      : sessions(std::move(scenes), options.limits, options.realtime, options.recordings),
        context{sessions, {}},
        calls(&context, std::move(about)),
        session_service(&calls),
        interaction_service(&context),
        view_service(&context),
        recording_service(&context) {}

  Sessions sessions;
  ServiceContext context;
  SessionCalls calls;
  SessionService session_service;
  InteractionService interaction_service;
  ViewService view_service;
  RecordingService recording_service;
  std::unique_ptr<WebServer> web;
  std::unique_ptr<grpc::Server> server;
};

Server::Server(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

Server::~Server() { Shutdown(0); }

absl::StatusOr<std::unique_ptr<Server>> Server::Start(const Options& options, SceneSource scenes) {
  absl::Status status = CheckListen("--listen", options.listen, options.insecure_listen);
  if (!status.ok()) return status;
  EnablePlugins();
  SessionCalls::About about;
  about.version = options.version;
  if (options.realtime) {
    about.realtime_class = ProbeRealtimeClass();
    about.memory_locked = LockMemory();
  }
  std::unique_ptr<Server> result(
      new Server(std::make_unique<Parts>(options, std::move(scenes), std::move(about))));
  Parts& parts = *result->parts_;
  grpc::ServerBuilder builder;
  Configure(options.limits, &builder);
  int port = 0;
  builder.AddListeningPort(options.listen, grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&parts.session_service);
  builder.RegisterService(&parts.interaction_service);
  builder.RegisterService(&parts.view_service);
  builder.RegisterService(&parts.recording_service);
  parts.server = builder.BuildAndStart();
  const bool is_unix = options.listen.starts_with("unix:");
  if (parts.server == nullptr || (port == 0 && !is_unix)) {
    return absl::UnavailableError(absl::StrCat("cannot listen on ", options.listen,
                                               ": the port is taken, or the address is not ours"));
  }
  if (!options.http.empty()) {
    WebServer::Options web;
    web.listen = options.http;
    web.insecure_listen = options.insecure_listen;
    absl::StatusOr<std::unique_ptr<WebServer>> started =
        WebServer::Start(web, &parts.context, &parts.calls);
    if (!started.ok()) return started.status();
    parts.web = *std::move(started);
    result->http_address_ = parts.web->address();
  }
  result->address_ = options.listen;
  if (!is_unix) {
    result->address_ = absl::StrCat(options.listen.substr(0, options.listen.rfind(':') + 1), port);
  }
  return result;
}

std::string Server::realtime_class() const {
  switch (parts_->calls.about().realtime_class) {
    case RealtimeClass::kFifo:
      return "fifo";
    case RealtimeClass::kShortSlice:
      return "short slice";
    case RealtimeClass::kPlain:
      return "plain";
  }
  return "";
}

bool Server::memory_locked() const { return parts_->calls.about().memory_locked; }

void Server::Shutdown(double grace_s, const std::atomic<bool>* hurry) {
  if (parts_->server == nullptr) return;
  if (auto* health = parts_->server->GetHealthCheckService()) health->SetServingStatus(false);
  parts_->sessions.Drain();
  const std::int64_t until_ns = MonotonicNs() + static_cast<std::int64_t>(grace_s * 1e9);
  while (parts_->context.streams.total() > 0 && MonotonicNs() < until_ns &&
         !(hurry != nullptr && hurry->load())) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  parts_->sessions.StopAll(Error(Reason::kDraining, "the server is going away; try another"));
  // Streams were ended by that; clients are told, and then their connections end.
  if (parts_->web != nullptr) parts_->web->Stop();
  // Over gRPC, this waits for it, and cancels whatever is still open.
  parts_->server->Shutdown(std::chrono::system_clock::now() + kCancelAfter);
  parts_->server->Wait();
  parts_->server.reset();
}

}  // namespace adhesim
