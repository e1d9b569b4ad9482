#include <gtest/gtest.h>

#include "test_server.h"

namespace adhesim {
namespace {

using Stub = v1::SessionService::Stub;
using SessionServiceTest = ServerTest;

TEST_F(SessionServiceTest, CreatesStepsPausesResetsAndDeletes) {
  const std::string id = Create(true);
  v1::Session session;
  ASSERT_TRUE(Step(id, 12, &session).ok());
  EXPECT_EQ(session.step(), 12u);
  EXPECT_EQ(session.session(), id);
  // A sum of 12 steps of a millisecond, as the fake multiplies: a rounding error.
  EXPECT_NEAR(session.time_s(), 0.012, 1e-15);

  v1::ResumeSessionRequest resume;
  resume.set_session(id);
  v1::ResumeSessionResponse resumed;
  ASSERT_TRUE(Call(&Stub::ResumeSession, resume, &resumed).ok());
  EXPECT_EQ(resumed.session().state(), v1::SESSION_STATE_RUNNING);
  WaitFor(id, [](const v1::Session& now) { return now.step() > 20; });

  v1::PauseSessionRequest pause;
  pause.set_session(id);
  v1::PauseSessionResponse paused;
  ASSERT_TRUE(Call(&Stub::PauseSession, pause, &paused).ok());
  EXPECT_EQ(paused.session().state(), v1::SESSION_STATE_PAUSED);
  EXPECT_EQ(Get(id).step(), paused.session().step());

  v1::ResetSessionRequest reset;
  reset.set_session(id);
  v1::ResetSessionResponse was_reset;
  ASSERT_TRUE(Call(&Stub::ResetSession, reset, &was_reset).ok());
  EXPECT_EQ(was_reset.session().step(), 0u);
  EXPECT_EQ(was_reset.session().state(), v1::SESSION_STATE_PAUSED);

  v1::DeleteSessionRequest remove;
  remove.set_session(id);
  v1::DeleteSessionResponse removed;
  EXPECT_TRUE(Call(&Stub::DeleteSession, remove, &removed).ok());
  const grpc::Status again = Call(&Stub::DeleteSession, remove, &removed);
  EXPECT_EQ(again.error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(SessionServiceTest, KnowsNoOtherSessions) {
  v1::GetSessionRequest get;
  get.set_session("s9-none");
  v1::GetSessionResponse got;
  const grpc::Status status = Call(&Stub::GetSession, get, &got);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(ReasonIn(status), "SESSION_NOT_FOUND");
  EXPECT_EQ(status.error_message(), "no session \"s9-none\"");
  EXPECT_EQ(ReasonIn(Step("s9-none", 1)), "SESSION_NOT_FOUND");
  v1::DeleteSessionRequest remove;
  v1::DeleteSessionResponse removed;
  EXPECT_EQ(ReasonIn(Call(&Stub::DeleteSession, remove, &removed)), "SESSION_NOT_FOUND");
}

TEST_F(SessionServiceTest, ListsScenesAndSessions) {
  v1::ListScenesResponse scenes;
  ASSERT_TRUE(Call(&Stub::ListScenes, v1::ListScenesRequest(), &scenes).ok());
  ASSERT_EQ(scenes.scenes_size(), 2);
  EXPECT_EQ(scenes.scenes(0).name(), "fake");
  const std::string first = Create(true), second = Create(true);
  v1::ListSessionsResponse sessions;
  ASSERT_TRUE(Call(&Stub::ListSessions, v1::ListSessionsRequest(), &sessions).ok());
  ASSERT_EQ(sessions.sessions_size(), 2);
  EXPECT_EQ(sessions.sessions(0).session(), first);
  EXPECT_EQ(sessions.sessions(1).session(), second);
}

TEST_F(SessionServiceTest, TakesAnInlineSceneWithRateAndSeed) {
  v1::CreateSessionRequest request;
  request.mutable_scene()->set_name("mine");
  request.mutable_scene()->add_bodies()->set_name("tissue");
  request.set_rate_hz(500);
  request.set_paused(true);
  v1::CreateSessionResponse response;
  ASSERT_TRUE(Call(&Stub::CreateSession, request, &response).ok());
  EXPECT_EQ(response.session().scene(), "mine");
  EXPECT_EQ(response.session().rate_hz(), 500);
  EXPECT_EQ(response.session().tools(0), "needle");
}

TEST_F(SessionServiceTest, NamesEveryWrongFieldOfAnInlineScene) {
  v1::CreateSessionRequest request;
  request.mutable_scene()->add_bodies();
  v1::CreateSessionResponse response;
  const grpc::Status status = Call(&Stub::CreateSession, request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(ReasonIn(status), "SCENE_INVALID");
  google::rpc::Status details;
  ASSERT_TRUE(details.ParseFromString(status.error_details()));
  google::rpc::BadRequest bad;
  ASSERT_TRUE(details.details(1).UnpackTo(&bad));
  EXPECT_EQ(bad.field_violations(0).field(), "scene.bodies[0].name");
}

TEST_F(SessionServiceTest, RefusesARequestLargerThanItsLimit) {
  v1::CreateSessionRequest request;
  request.mutable_scene()->set_description(std::string(17 << 20, 'x'));
  v1::CreateSessionResponse response;
  EXPECT_EQ(Call(&Stub::CreateSession, request, &response).error_code(),
            grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_FALSE(Create(true).empty());  // and goes on
}

TEST_F(SessionServiceTest, TellsAboutTheServer) {
  Create(true);
  v1::GetServerInfoResponse info;
  ASSERT_TRUE(Call(&Stub::GetServerInfo, v1::GetServerInfoRequest(), &info).ok());
  EXPECT_EQ(info.version(), "test");
  EXPECT_EQ(info.realtime_class(), v1::REALTIME_CLASS_PLAIN);  // asked for by these tests
  EXPECT_EQ(info.sessions(), 1u);
  EXPECT_FALSE(info.draining());
  EXPECT_EQ(info.limits().stream_message_bytes(), 64u << 10);
}

TEST_F(SessionServiceTest, GoesOnBesideAFrozenSession) {
  const std::string frozen = Create(false, "freezes");
  const std::string other = Create(false);
  WaitFor(frozen, [](const v1::Session& now) { return now.state() == v1::SESSION_STATE_FROZEN; });
  EXPECT_EQ(ReasonIn(Step(frozen, 1)), "SESSION_FROZEN");
  const std::uint64_t step = Get(other).step();
  WaitFor(other, [step](const v1::Session& now) { return now.step() > step + 10; });
}

}  // namespace
}  // namespace adhesim
