#include "server/session_service.h"

#include <thread>
#include <utility>

#include "server/encode.h"
#include "server/errors.h"
#include "server/grpc_status.h"

namespace adhesim {
namespace {

// Two, so that one slow scene does not keep a deletion waiting.
constexpr int kWorkers = 2;
constexpr std::size_t kMaxWaiting = 64;

grpc::ServerUnaryReactor* Now(grpc::CallbackServerContext* call, const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  reactor->Finish(ToGrpcStatus(status));
  return reactor;
}

}  // namespace

SessionService::SessionService(ServiceContext* context, About about)
    : context_(context), about_(std::move(about)), workers_(kWorkers, kMaxWaiting) {}

SessionService::Reactor* SessionService::Later(Call* call, std::function<absl::Status()> work) {
  Reactor* reactor = call->DefaultReactor();
  const bool accepted =
      workers_.Post([reactor, work = std::move(work)] { reactor->Finish(ToGrpcStatus(work())); });
  if (!accepted) {
    reactor->Finish(ToGrpcStatus(
        Error(Reason::kTooManyRequests, "64 requests are waiting already; try again later")));
  }
  return reactor;
}

SessionService::Reactor* SessionService::Command(Call* call, const std::string& session,
                                                 Session::CommandKind kind, std::uint32_t steps,
                                                 v1::Session* described) {
  const auto live = context_->sessions.Find(session);
  if (!live.ok()) return Now(call, live.status());
  Reactor* reactor = call->DefaultReactor();
  // Called on a thread of the session's own, which therefore exists then.
  LiveSession* const subject = live->get();
  const auto done = [reactor, described, subject](const absl::Status& status) {
    if (status.ok()) *described = subject->Describe();
    reactor->Finish(ToGrpcStatus(status));
  };
  const absl::Status submitted = (*live)->session->Submit(kind, steps, done);
  if (!submitted.ok()) reactor->Finish(ToGrpcStatus(submitted));
  return reactor;
}

SessionService::Reactor* SessionService::ListScenes(Call* call, const v1::ListScenesRequest*,
                                                    v1::ListScenesResponse* response) {
  return Later(call, [this, response] {
    for (const OfferedScene& scene : context_->sessions.ListScenes()) {
      v1::SceneSummary* summary = response->add_scenes();
      summary->set_name(scene.name);
      summary->set_description(scene.description);
    }
    return absl::OkStatus();
  });
}

SessionService::Reactor* SessionService::CreateSession(Call* call,
                                                       const v1::CreateSessionRequest* request,
                                                       v1::CreateSessionResponse* response) {
  return Later(call, [this, call, request, response] {
    std::vector<std::string> warnings;
    const auto live = context_->sessions.Create(*request, call->peer(), &warnings);
    if (!live.ok()) return live.status();
    if (call->IsCancelled()) {
      // Nobody would know its id.
      context_->sessions.Delete((*live)->id).IgnoreError();
      return absl::CancelledError("the client is gone");
    }
    *response->mutable_session() = (*live)->Describe();
    for (std::string& warning : warnings) response->add_warnings(std::move(warning));
    return absl::OkStatus();
  });
}

SessionService::Reactor* SessionService::GetSession(Call* call,
                                                    const v1::GetSessionRequest* request,
                                                    v1::GetSessionResponse* response) {
  const auto live = context_->sessions.Find(request->session());
  if (live.ok()) *response->mutable_session() = (*live)->Describe();
  return Now(call, live.status());
}

SessionService::Reactor* SessionService::ListSessions(Call* call, const v1::ListSessionsRequest*,
                                                      v1::ListSessionsResponse* response) {
  for (const auto& live : context_->sessions.List()) *response->add_sessions() = live->Describe();
  return Now(call, absl::OkStatus());
}

SessionService::Reactor* SessionService::DeleteSession(Call* call,
                                                       const v1::DeleteSessionRequest* request,
                                                       v1::DeleteSessionResponse*) {
  return Later(call, [this, request] { return context_->sessions.Delete(request->session()); });
}

SessionService::Reactor* SessionService::PauseSession(Call* call,
                                                      const v1::PauseSessionRequest* request,
                                                      v1::PauseSessionResponse* response) {
  return Command(call, request->session(), Session::CommandKind::kPause, 0,
                 response->mutable_session());
}

SessionService::Reactor* SessionService::ResumeSession(Call* call,
                                                       const v1::ResumeSessionRequest* request,
                                                       v1::ResumeSessionResponse* response) {
  return Command(call, request->session(), Session::CommandKind::kResume, 0,
                 response->mutable_session());
}

SessionService::Reactor* SessionService::StepSession(Call* call,
                                                     const v1::StepSessionRequest* request,
                                                     v1::StepSessionResponse* response) {
  const std::uint32_t steps = request->has_steps() ? request->steps() : 1;
  return Command(call, request->session(), Session::CommandKind::kStep, steps,
                 response->mutable_session());
}

SessionService::Reactor* SessionService::ResetSession(Call* call,
                                                      const v1::ResetSessionRequest* request,
                                                      v1::ResetSessionResponse* response) {
  return Command(call, request->session(), Session::CommandKind::kReset, 0,
                 response->mutable_session());
}

SessionService::Reactor* SessionService::GetServerInfo(Call* call, const v1::GetServerInfoRequest*,
                                                       v1::GetServerInfoResponse* response) {
  const Limits& limits = context_->sessions.limits();
  response->set_version(about_.version);
  response->set_realtime_class(EncodeRealtimeClass(about_.realtime_class));
  response->set_memory_locked(about_.memory_locked);
  response->set_processors(std::thread::hardware_concurrency());
  response->set_sessions(context_->sessions.List().size());
  response->set_draining(context_->sessions.draining());
  response->mutable_limits()->set_sessions(limits.sessions);
  response->mutable_limits()->set_sessions_per_peer(limits.sessions_per_peer);
  response->mutable_limits()->set_streams_per_peer(limits.streams_per_peer);
  response->mutable_limits()->set_particles(limits.particles);
  response->mutable_limits()->set_request_bytes(limits.request_bytes);
  response->mutable_limits()->set_stream_message_bytes(limits.stream_message_bytes);
  response->set_server_time_ns(MonotonicNs());
  return Now(call, absl::OkStatus());
}

}  // namespace adhesim
