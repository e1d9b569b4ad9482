#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

#include "adhesim/v1/interaction_service.grpc.pb.h"
#include "adhesim/v1/session_service.grpc.pb.h"
#include "adhesim/v1/view_service.grpc.pb.h"
#include "fake_engine.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/server.h"
#include "server/session.h"

namespace adhesim {

// The reason in the details of an error, which must hold exactly one ErrorInfo.
inline std::string ReasonIn(const grpc::Status& status) {
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(status.error_details())) << status.error_message();
  EXPECT_EQ(details.code(), status.error_code());
  std::string reason;
  for (const auto& detail : details.details()) {
    google::rpc::ErrorInfo info;
    if (!detail.UnpackTo(&info)) continue;
    EXPECT_TRUE(reason.empty());
    EXPECT_EQ(info.domain(), "adhesim");
    reason = info.reason();
  }
  return reason;
}

// A server with fake physics in this process, and a client's end of it. Every call has a deadline,
// so that a test fails rather than hangs.
class ServerTest : public testing::Test {
 protected:
  explicit ServerTest(Limits limits = {}) {
    Server::Options options;
    options.listen = "127.0.0.1:0";
    options.realtime = false;
    options.version = "test";
    options.limits = limits;
    absl::StatusOr<std::unique_ptr<Server>> server = Server::Start(options, FakeScenes());
    EXPECT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    channel_ = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    sessions_ = v1::SessionService::NewStub(channel_);
    interaction_ = v1::InteractionService::NewStub(channel_);
    view_ = v1::ViewService::NewStub(channel_);
  }

  static void SetDeadline(grpc::ClientContext* context) {
    context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  }

  // One unary call: Call(&v1::SessionService::Stub::GetSession, request, &response).
  template <typename Method, typename Request, typename Response>
  grpc::Status Call(Method method, const Request& request, Response* response) {
    grpc::ClientContext context;
    SetDeadline(&context);
    return (sessions_.get()->*method)(&context, request, response);
  }

  std::string Create(bool paused, const std::string& scene = "fake") {
    v1::CreateSessionRequest request;
    request.set_scene_name(scene);
    request.set_paused(paused);
    v1::CreateSessionResponse response;
    const grpc::Status status = Call(&v1::SessionService::Stub::CreateSession, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.session().session();
  }

  v1::Session Get(const std::string& id) {
    v1::GetSessionRequest request;
    request.set_session(id);
    v1::GetSessionResponse response;
    EXPECT_TRUE(Call(&v1::SessionService::Stub::GetSession, request, &response).ok());
    return response.session();
  }

  grpc::Status Step(const std::string& id, std::uint32_t steps, v1::Session* session = nullptr) {
    v1::StepSessionRequest request;
    request.set_session(id);
    request.set_steps(steps);
    v1::StepSessionResponse response;
    const grpc::Status status = Call(&v1::SessionService::Stub::StepSession, request, &response);
    if (session != nullptr) *session = response.session();
    return status;
  }

  // Waits until a condition on a session holds.
  template <typename Condition>
  void WaitFor(const std::string& id, const Condition& condition) {
    for (int i = 0; i < 3000; ++i) {
      if (condition(Get(id))) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    ADD_FAILURE() << "it did not happen within 30 s: " << Get(id).DebugString();
  }

  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::SessionService::Stub> sessions_;
  std::unique_ptr<v1::InteractionService::Stub> interaction_;
  std::unique_ptr<v1::ViewService::Stub> view_;
};

// An operator's stream.
struct OperatorClient {
  OperatorClient(v1::InteractionService::Stub* stub) {
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    stream = stub->Interact(&context);
  }
  // Takes control; false when that was refused.
  bool Take(const std::string& session, const std::string& tool) {
    v1::InteractRequest request;
    request.mutable_take_control()->set_session(session);
    request.mutable_take_control()->set_tool(tool);
    v1::InteractResponse response;
    return stream->Write(request) && stream->Read(&response) && response.has_control_taken();
  }
  bool Send(std::uint64_t sequence, double x_m, double qw = 1) {
    v1::InteractRequest request;
    request.mutable_pose()->set_sequence(sequence);
    request.mutable_pose()->set_client_time_ns(1000 + sequence);
    request.mutable_pose()->mutable_pose()->set_x_m(x_m);
    request.mutable_pose()->mutable_pose()->set_qw(qw);
    return stream->Write(request);
  }
  // The next response that fits; a default one when the stream ends.
  template <typename Condition>
  v1::InteractResponse ReadUntil(const Condition& condition) {
    v1::InteractResponse response;
    while (stream->Read(&response)) {
      if (condition(response)) return response;
    }
    ADD_FAILURE() << "the stream has ended";
    return {};
  }
  // Reads to the end.
  grpc::Status Finish() {
    v1::InteractResponse response;
    while (stream->Read(&response)) {
    }
    return stream->Finish();
  }

  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReaderWriter<v1::InteractRequest, v1::InteractResponse>> stream;
};

// A viewer's stream.
struct ViewerClient {
  ViewerClient(v1::ViewService::Stub* stub) {
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    stream = stub->Watch(&context);
  }
  bool Start(const std::string& session, double max_rate_hz = 1000) {
    v1::WatchRequest request;
    request.mutable_start()->set_session(session);
    request.mutable_start()->set_max_rate_hz(max_rate_hz);
    return stream->Write(request);
  }
  bool Acknowledge() {
    v1::WatchRequest request;
    request.mutable_ack()->set_frames(frames);
    return stream->Write(request);
  }
  // The next frame; a default one when the stream ends.
  v1::WatchResponse ReadFrame() {
    v1::WatchResponse response;
    while (stream->Read(&response)) {
      if (!response.has_frame()) continue;
      ++frames;
      return response;
    }
    ADD_FAILURE() << "the stream has ended";
    return {};
  }
  grpc::Status Finish() {
    v1::WatchResponse response;
    while (stream->Read(&response)) {
    }
    return stream->Finish();
  }

  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReaderWriter<v1::WatchRequest, v1::WatchResponse>> stream;
  std::uint64_t frames = 0;
};

}  // namespace adhesim
