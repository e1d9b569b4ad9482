#include "server/server.h"

#include <gtest/gtest.h>

#include <thread>

#include "test_server.h"

namespace adhesim {
namespace {

Server::Options On(const std::string& listen) {
  Server::Options options;
  options.listen = listen;
  options.realtime = false;
  return options;
}

using RunningServerTest = ServerTest;

TEST_F(RunningServerTest, KeepsItsPortToItself) {
  const absl::Status status = Server::Start(On(server_->address()), FakeScenes()).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
}

TEST(Server, ListensOnLoopbackOnlyUnlessTold) {
  const absl::Status status = Server::Start(On("0.0.0.0:0"), FakeScenes()).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_NE(status.message().find("--insecure-listen"), std::string::npos);
  Server::Options options = On("0.0.0.0:0");
  options.insecure_listen = true;
  EXPECT_TRUE(Server::Start(options, FakeScenes()).ok());
}

TEST(Server, KnowsWhatIsLoopback) {
  for (const char* inside :
       {"127.0.0.1:1", "127.9.9.9:0", "localhost:50051", "[::1]:1", "unix:/x"}) {
    EXPECT_TRUE(IsLoopback(inside)) << inside;
  }
  for (const char* outside :
       {"0.0.0.0:1", "[::]:1", "10.0.0.1:1", "example.org:1", "127.example.org:1", ":1", ""}) {
    EXPECT_FALSE(IsLoopback(outside)) << outside;
  }
}

TEST_F(RunningServerTest, LetsStreamsEndAndTakesNothingNewWhileItDrains) {
  const std::string id = Create(false);
  OperatorClient client(interaction_.get());
  ASSERT_TRUE(client.Take(id, "needle"));
  std::thread shutdown([this] { server_->Shutdown(60); });
  client.ReadUntil([](const v1::InteractResponse& response) {
    return response.has_heartbeat() && response.heartbeat().draining();
  });
  v1::CreateSessionRequest request;
  request.set_scene_name("fake");
  v1::CreateSessionResponse response;
  const grpc::Status status = Call(&v1::SessionService::Stub::CreateSession, request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(ReasonIn(status), "DRAINING");
  EXPECT_GT(Get(id).step(), 0u);  // the session goes on
  client.stream->WritesDone();
  EXPECT_TRUE(client.Finish().ok());
  shutdown.join();  // long before its grace is over
}

TEST_F(RunningServerTest, EndsStreamsWhenItsGraceIsOver) {
  const std::string id = Create(false);
  OperatorClient operator_client(interaction_.get());
  ASSERT_TRUE(operator_client.Take(id, "needle"));
  ViewerClient viewer(view_.get());
  ASSERT_TRUE(viewer.Start(id));
  viewer.ReadFrame();
  OperatorClient silent(interaction_.get());  // never says what it wants
  v1::InteractRequest request;
  std::thread shutdown([this] { server_->Shutdown(0.1); });
  grpc::Status status = operator_client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(ReasonIn(status), "DRAINING");
  EXPECT_EQ(ReasonIn(viewer.Finish()), "DRAINING");
  EXPECT_FALSE(silent.Finish().ok());
  shutdown.join();
}

TEST_F(RunningServerTest, EndsBesideAStepCommandThatTakesLong) {
  const std::string id = Create(true);
  std::thread caller([this, id] {
    // Answered with an error when the session ends, whichever of the two calls it is by then.
    while (Step(id, Session::kMaxStepsAtOnce).ok()) {
    }
  });
  WaitFor(id, [](const v1::Session& now) { return now.step() > 0; });
  server_->Shutdown(0);
  caller.join();
}

}  // namespace
}  // namespace adhesim
