#include "server/session_calls.h"

#include <absl/strings/str_cat.h>

#include <thread>
#include <utility>
#include <vector>

#include "server/encode.h"
#include "server/errors.h"

namespace adhesim {
namespace {

// Scenes are built apart from the rest, so that slow ones keep nothing else waiting; two at a time,
// and no more than so many of one peer under way, so that they leave room for others.
constexpr int kBuilders = 2;
constexpr std::uint32_t kBuildsPerPeer = 8;
constexpr int kWorkers = 1;
constexpr std::size_t kMaxWaiting = 64;

}  // namespace

SessionCalls::SessionCalls(ServiceContext* context, About about)
    : context_(context),
      about_(std::move(about)),
      workers_(kWorkers, kMaxWaiting),
      builders_(kBuilders, kMaxWaiting) {}

void SessionCalls::Later(Workers* workers, std::function<absl::Status()> work, Done done) {
  // One of the two has it in the end.
  const auto shared_done = std::make_shared<Done>(std::move(done));
  const bool accepted =
      workers->Post([shared_done, work = std::move(work)] { (*shared_done)(work()); });
  if (!accepted) {
    (*shared_done)(
        Error(Reason::kTooManyRequests, "64 requests are waiting already; try again later"));
  }
}

void SessionCalls::Command(const std::string& session, Session::CommandKind kind,
                           std::uint32_t steps, v1::Session* described, Done done) {
  const auto live = context_->sessions.Find(session);
  if (!live.ok()) {
    done(live.status());
    return;
  }
  // Called on a thread of the session's own, which therefore exists then.
  LiveSession* const subject = live->get();
  const auto answer = [done, described, subject](const absl::Status& status) {
    if (status.ok()) *described = subject->Describe();
    done(status);
  };
  const absl::Status submitted = (*live)->session->Submit(kind, steps, answer);
  if (!submitted.ok()) done(submitted);
}

void SessionCalls::Handle(const Caller&, const v1::ListScenesRequest&,
                          v1::ListScenesResponse* response, Done done) {
  const auto list = [this, response] {
    for (const OfferedScene& scene : context_->sessions.ListScenes()) {
      v1::SceneSummary* summary = response->add_scenes();
      summary->set_name(scene.name);
      summary->set_description(scene.description);
    }
    return absl::OkStatus();
  };
  Later(&workers_, list, std::move(done));
}

void SessionCalls::Handle(const Caller& caller, const v1::CreateSessionRequest& request,
                          v1::CreateSessionResponse* response, Done done) {
  // Given back with the work.
  PeerCounter::Share share = builds_.Take(PeerHost(caller.peer), kBuildsPerPeer);
  if (share == nullptr) {
    done(Error(Reason::kTooManyRequests,
               absl::StrCat(kBuildsPerPeer,
                            " sessions are being created for this peer already, "
                            "more at a time are not permitted")));
    return;
  }
  const auto create = [this, caller, &request, response,
                       share = std::move(share)]() -> absl::Status {
    std::vector<std::string> warnings;
    const auto live = context_->sessions.Create(request, caller.peer, &warnings);
    if (!live.ok()) return live.status();
    if (caller.gone()) {
      // Nobody would know its id.
      context_->sessions.Delete((*live)->id).IgnoreError();
      return absl::CancelledError("the client is gone");
    }
    *response->mutable_session() = (*live)->Describe();
    for (std::string& warning : warnings) response->add_warnings(std::move(warning));
    return absl::OkStatus();
  };
  Later(&builders_, create, std::move(done));
}

void SessionCalls::Handle(const Caller&, const v1::GetSessionRequest& request,
                          v1::GetSessionResponse* response, Done done) {
  const auto live = context_->sessions.Find(request.session());
  if (live.ok()) *response->mutable_session() = (*live)->Describe();
  done(live.status());
}

void SessionCalls::Handle(const Caller&, const v1::ListSessionsRequest&,
                          v1::ListSessionsResponse* response, Done done) {
  for (const auto& live : context_->sessions.List()) *response->add_sessions() = live->Describe();
  done(absl::OkStatus());
}

void SessionCalls::Handle(const Caller&, const v1::DeleteSessionRequest& request,
                          v1::DeleteSessionResponse*, Done done) {
  Later(
      &workers_, [this, &request] { return context_->sessions.Delete(request.session()); },
      std::move(done));
}

void SessionCalls::Handle(const Caller&, const v1::PauseSessionRequest& request,
                          v1::PauseSessionResponse* response, Done done) {
  Command(request.session(), Session::CommandKind::kPause, 0, response->mutable_session(),
          std::move(done));
}

void SessionCalls::Handle(const Caller&, const v1::ResumeSessionRequest& request,
                          v1::ResumeSessionResponse* response, Done done) {
  Command(request.session(), Session::CommandKind::kResume, 0, response->mutable_session(),
          std::move(done));
}

void SessionCalls::Handle(const Caller&, const v1::StepSessionRequest& request,
                          v1::StepSessionResponse* response, Done done) {
  const std::uint32_t steps = request.has_steps() ? request.steps() : 1;
  Command(request.session(), Session::CommandKind::kStep, steps, response->mutable_session(),
          std::move(done));
}

void SessionCalls::Handle(const Caller&, const v1::ResetSessionRequest& request,
                          v1::ResetSessionResponse* response, Done done) {
  Command(request.session(), Session::CommandKind::kReset, 0, response->mutable_session(),
          std::move(done));
}

void SessionCalls::Handle(const Caller&, const v1::GetServerInfoRequest&,
                          v1::GetServerInfoResponse* response, Done done) {
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
  done(absl::OkStatus());
}

void SessionCalls::Handle(const Caller&, const v1::ListRecordingsRequest&,
                          v1::ListRecordingsResponse* response, Done done) {
  const auto list = [this, response] {
    const auto& recordings = context_->sessions.recordings();
    if (recordings.list) *response = recordings.list();
    return absl::OkStatus();
  };
  Later(&workers_, list, std::move(done));
}

}  // namespace adhesim
