#pragma once

#include <grpcpp/support/server_callback.h>

#include <functional>
#include <string>

#include "adhesim/v1/session_service.grpc.pb.h"
#include "server/service_context.h"
#include "server/workers.h"

namespace adhesim {

// Everything about sessions but their streams. Work that may take long is done by workers.
class SessionService final : public v1::SessionService::CallbackService {
 public:
  struct About {
    std::string version;
    RealtimeClass realtime_class = RealtimeClass::kPlain;
    bool memory_locked = false;
  };

  SessionService(ServiceContext* context, About about);

  using Call = grpc::CallbackServerContext;
  using Reactor = grpc::ServerUnaryReactor;
  Reactor* ListScenes(Call* call, const v1::ListScenesRequest* request,
                      v1::ListScenesResponse* response) override;
  Reactor* CreateSession(Call* call, const v1::CreateSessionRequest* request,
                         v1::CreateSessionResponse* response) override;
  Reactor* GetSession(Call* call, const v1::GetSessionRequest* request,
                      v1::GetSessionResponse* response) override;
  Reactor* ListSessions(Call* call, const v1::ListSessionsRequest* request,
                        v1::ListSessionsResponse* response) override;
  Reactor* DeleteSession(Call* call, const v1::DeleteSessionRequest* request,
                         v1::DeleteSessionResponse* response) override;
  Reactor* PauseSession(Call* call, const v1::PauseSessionRequest* request,
                        v1::PauseSessionResponse* response) override;
  Reactor* ResumeSession(Call* call, const v1::ResumeSessionRequest* request,
                         v1::ResumeSessionResponse* response) override;
  Reactor* StepSession(Call* call, const v1::StepSessionRequest* request,
                       v1::StepSessionResponse* response) override;
  Reactor* ResetSession(Call* call, const v1::ResetSessionRequest* request,
                        v1::ResetSessionResponse* response) override;
  Reactor* GetServerInfo(Call* call, const v1::GetServerInfoRequest* request,
                         v1::GetServerInfoResponse* response) override;

 private:
  // Answers with the status of `work`, done by a worker.
  Reactor* Later(Call* call, std::function<absl::Status()> work);
  // Answers when the session has carried out the command.
  Reactor* Command(Call* call, const std::string& session, Session::CommandKind kind,
                   std::uint32_t steps, v1::Session* described);

  ServiceContext* const context_;
  const About about_;
  Workers workers_;
};

}  // namespace adhesim
