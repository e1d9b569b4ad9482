#pragma once

#include <grpcpp/support/server_callback.h>

#include "adhesim/v1/session_service.grpc.pb.h"
#include "server/grpc_status.h"
#include "server/session_calls.h"

namespace adhesim {

// A call over gRPC, answered by `calls`.
template <typename Request, typename Response>
grpc::ServerUnaryReactor* AnswerCall(SessionCalls* calls, grpc::CallbackServerContext* call,
                                     const Request* request, Response* response) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  const SessionCalls::Caller caller{call->peer(), [call] { return call->IsCancelled(); }};
  calls->Handle(caller, *request, response,
                [reactor](const absl::Status& status) { reactor->Finish(ToGrpcStatus(status)); });
  return reactor;
}

// Everything about sessions but their streams, over gRPC.
class SessionService final : public v1::SessionService::CallbackService {
 public:
  explicit SessionService(SessionCalls* calls) : calls_(calls) {}

  using Call = grpc::CallbackServerContext;
  using Reactor = grpc::ServerUnaryReactor;
  Reactor* ListScenes(Call* call, const v1::ListScenesRequest* request,
                      v1::ListScenesResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* CreateSession(Call* call, const v1::CreateSessionRequest* request,
                         v1::CreateSessionResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* GetSession(Call* call, const v1::GetSessionRequest* request,
                      v1::GetSessionResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* ListSessions(Call* call, const v1::ListSessionsRequest* request,
                        v1::ListSessionsResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* DeleteSession(Call* call, const v1::DeleteSessionRequest* request,
                         v1::DeleteSessionResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* PauseSession(Call* call, const v1::PauseSessionRequest* request,
                        v1::PauseSessionResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* ResumeSession(Call* call, const v1::ResumeSessionRequest* request,
                         v1::ResumeSessionResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* StepSession(Call* call, const v1::StepSessionRequest* request,
                       v1::StepSessionResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* ResetSession(Call* call, const v1::ResetSessionRequest* request,
                        v1::ResetSessionResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }
  Reactor* GetServerInfo(Call* call, const v1::GetServerInfoRequest* request,
                         v1::GetServerInfoResponse* response) override {
    return AnswerCall(calls_, call, request, response);
  }

 private:
  SessionCalls* const calls_;
};

}  // namespace adhesim
