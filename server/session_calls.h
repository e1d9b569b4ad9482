#pragma once

#include <absl/status/status.h>

#include <functional>
#include <string>

#include "adhesim/v1/recording_service.pb.h"
#include "adhesim/v1/session_service.pb.h"
#include "server/limits.h"
#include "server/service_context.h"
#include "server/workers.h"

namespace adhesim {

// Answers every request that has one answer, over whatever transport. Thread-safe, and never
// blocks: work that may take long is done by workers.
class SessionCalls {
 public:
  struct About {
    std::string version;
    RealtimeClass realtime_class = RealtimeClass::kPlain;
    bool memory_locked = false;
  };

  // Who asks.
  struct Caller {
    std::string peer;            // as in PeerHost()
    std::function<bool()> gone;  // nobody waits for the answer any more
  };
  // Called once, on any thread, perhaps before Handle() returns. Request and response live until
  // then.
  using Done = std::function<void(const absl::Status&)>;

  SessionCalls(ServiceContext* context, About about);

  void Handle(const Caller& caller, const v1::ListScenesRequest& request,
              v1::ListScenesResponse* response, Done done);
  void Handle(const Caller& caller, const v1::CreateSessionRequest& request,
              v1::CreateSessionResponse* response, Done done);
  void Handle(const Caller& caller, const v1::GetSessionRequest& request,
              v1::GetSessionResponse* response, Done done);
  void Handle(const Caller& caller, const v1::ListSessionsRequest& request,
              v1::ListSessionsResponse* response, Done done);
  void Handle(const Caller& caller, const v1::DeleteSessionRequest& request,
              v1::DeleteSessionResponse* response, Done done);
  void Handle(const Caller& caller, const v1::PauseSessionRequest& request,
              v1::PauseSessionResponse* response, Done done);
  void Handle(const Caller& caller, const v1::ResumeSessionRequest& request,
              v1::ResumeSessionResponse* response, Done done);
  void Handle(const Caller& caller, const v1::StepSessionRequest& request,
              v1::StepSessionResponse* response, Done done);
  void Handle(const Caller& caller, const v1::ResetSessionRequest& request,
              v1::ResetSessionResponse* response, Done done);
  void Handle(const Caller& caller, const v1::GetServerInfoRequest& request,
              v1::GetServerInfoResponse* response, Done done);
  void Handle(const Caller& caller, const v1::ListRecordingsRequest& request,
              v1::ListRecordingsResponse* response, Done done);

  const About& about() const { return about_; }

 private:
  // Answers with the status of `work`, done by one of the workers.
  void Later(Workers* workers, std::function<absl::Status()> work, Done done);
  // Answers when the session has carried out the command.
  void Command(const std::string& session, Session::CommandKind kind, std::uint32_t steps,
               v1::Session* described, Done done);

  ServiceContext* const context_;
  const About about_;
  PeerCounter builds_;  // creations under way
  Workers workers_;
  Workers builders_;  // of scenes
};

}  // namespace adhesim
