#include "server/sessions.h"

#include <gtest/gtest.h>

#include "fake_engine.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/errors.h"

namespace adhesim {
namespace {

constexpr char kPeer[] = "ipv4:10.0.0.1:1234";

v1::CreateSessionRequest Named(const std::string& name) {
  v1::CreateSessionRequest request;
  request.set_scene_name(name);
  request.set_paused(true);
  return request;
}

class SessionsTest : public testing::Test {
 protected:
  explicit SessionsTest(Limits limits = {}) : sessions_(FakeScenes(), limits, false) {}

  absl::StatusOr<std::shared_ptr<LiveSession>> Create(const v1::CreateSessionRequest& request,
                                                      const std::string& peer = kPeer) {
    return sessions_.Create(request, peer, &warnings_);
  }
  std::string RefusalOf(const v1::CreateSessionRequest& request) {
    return ReasonOf(Create(request).status());
  }

  Sessions sessions_;
  std::vector<std::string> warnings_;
};

TEST_F(SessionsTest, AreCreatedFoundAndDeleted) {
  const auto live = Create(Named("fake"));
  ASSERT_TRUE(live.ok());
  const std::string id = (*live)->id;
  EXPECT_EQ((*live)->Describe().scene(), "fake");
  EXPECT_EQ((*live)->Describe().tools_size(), 2);
  EXPECT_TRUE(sessions_.Find(id).ok());
  EXPECT_EQ(sessions_.List().size(), 1u);
  EXPECT_TRUE(sessions_.Delete(id).ok());
  EXPECT_EQ(ReasonOf(sessions_.Find(id).status()), "SESSION_NOT_FOUND");
  EXPECT_EQ(ReasonOf(sessions_.Delete(id)), "SESSION_NOT_FOUND");
}

TEST_F(SessionsTest, RefuseWhatDoesNotSayAScene) {
  EXPECT_EQ(RefusalOf({}), "ARGUMENT_INVALID");
  EXPECT_EQ(RefusalOf(Named("nothing")), "SCENE_NOT_FOUND");
  v1::CreateSessionRequest request = Named("fake");
  request.set_rate_hz(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(RefusalOf(request), "ARGUMENT_INVALID");
  request.set_rate_hz(20'001);
  EXPECT_EQ(RefusalOf(request), "ARGUMENT_INVALID");
}

// They were measured at the scene's own rate.
TEST(Sessions, OfAnotherRateDeclareNoErrorsThatWereMeasured) {
  bool measured = false;
  SceneSource source = FakeScenes();
  source.build = [&](const ReadScene& read, Problems* problems) {
    measured = read.scene.has_rungs();
    return FakeScenes().build(read, problems);
  };
  Sessions sessions(source, {}, false);
  v1::CreateSessionRequest request;
  request.set_paused(true);
  v1::Scene* scene = request.mutable_scene();
  scene->set_rate_hz(500);
  scene->add_bodies()->set_name("tissue");
  scene->mutable_rungs()->mutable_iterations()->set_position_error(0.1);
  std::vector<std::string> warnings;
  ASSERT_TRUE(sessions.Create(request, kPeer, &warnings).ok());
  EXPECT_TRUE(measured);
  request.set_rate_hz(500);
  ASSERT_TRUE(sessions.Create(request, kPeer, &warnings).ok());
  EXPECT_TRUE(measured);
  request.set_rate_hz(400);
  ASSERT_TRUE(sessions.Create(request, kPeer, &warnings).ok());
  EXPECT_FALSE(measured);
}

TEST_F(SessionsTest, ReportEveryMistakeOfASceneAtOnce) {
  v1::CreateSessionRequest request;
  request.mutable_scene()->add_bodies();
  request.mutable_scene()->add_bodies();
  const absl::Status status = Create(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  google::rpc::Status details;
  ASSERT_TRUE(details.ParseFromString(ErrorDetails(status)));
  google::rpc::BadRequest bad;
  ASSERT_EQ(details.details_size(), 2);
  ASSERT_TRUE(details.details(1).UnpackTo(&bad));
  ASSERT_EQ(bad.field_violations_size(), 2);
  EXPECT_EQ(bad.field_violations(1).field(), "scene.bodies[1].name");
}

TEST_F(SessionsTest, KeepClientsAwayFromOtherFiles) {
  for (const char* file : {"/etc/passwd", "../secret.obj", "a/../../b.obj", "asset:../x"}) {
    v1::CreateSessionRequest request;
    v1::Body* body = request.mutable_scene()->add_bodies();
    body->set_name("tissue");
    body->mutable_mesh()->set_file(file);
    EXPECT_EQ(RefusalOf(request), "SCENE_INVALID") << file;
    body->mutable_label_map()->set_file(file);
    EXPECT_EQ(RefusalOf(request), "SCENE_INVALID") << file;
    body->mutable_tet_mesh()->set_file(file);
    EXPECT_EQ(RefusalOf(request), "SCENE_INVALID") << file;
  }
}

TEST_F(SessionsTest, RefuseHugeScenesBeforeBuildingThem) {
  v1::CreateSessionRequest request;
  v1::Body* body = request.mutable_scene()->add_bodies();
  body->set_name("tissue");
  body->mutable_sheet()->set_columns(4'000'000'000u);
  body->mutable_sheet()->set_rows(4'000'000'000u);
  EXPECT_EQ(RefusalOf(request), "SCENE_TOO_LARGE");
  body->mutable_icosphere()->set_subdivisions(4'000'000'000u);
  EXPECT_EQ(RefusalOf(request), "SCENE_TOO_LARGE");
  body->mutable_block()->set_cells(1'000'000);
  EXPECT_EQ(RefusalOf(request), "SCENE_TOO_LARGE");
}

TEST_F(SessionsTest, ServeNothingNewWhileDraining) {
  ASSERT_TRUE(Create(Named("fake")).ok());
  sessions_.Drain();
  const absl::Status status = Create(Named("fake")).status();
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_EQ(ReasonOf(status), "DRAINING");
  EXPECT_EQ(sessions_.List().size(), 1u);  // the others go on
}

class LimitedSessionsTest : public SessionsTest {
 protected:
  static Limits Few() {
    Limits limits;
    limits.sessions = 3;
    limits.sessions_per_peer = 2;
    return limits;
  }
  LimitedSessionsTest() : SessionsTest(Few()) {}
};

TEST_F(LimitedSessionsTest, AreLimitedForEachPeerAndInAll) {
  ASSERT_TRUE(Create(Named("fake"), "ipv4:10.0.0.1:1").ok());
  const auto second = Create(Named("fake"), "ipv4:10.0.0.1:2");
  ASSERT_TRUE(second.ok());
  EXPECT_EQ(ReasonOf(Create(Named("fake"), "ipv4:10.0.0.1:3").status()), "TOO_MANY_SESSIONS");
  ASSERT_TRUE(Create(Named("fake"), "ipv4:10.0.0.2:1").ok());
  EXPECT_EQ(ReasonOf(Create(Named("fake"), "ipv4:10.0.0.3:1").status()), "TOO_MANY_SESSIONS");
  // Refused and deleted ones do not count.
  ASSERT_TRUE(sessions_.Delete((*second)->id).ok());
  EXPECT_TRUE(Create(Named("fake"), "ipv4:10.0.0.1:4").ok());
}

TEST(PeerHost, DropsThePortOnly) {
  EXPECT_EQ(PeerHost("ipv4:10.0.0.1:123"), "ipv4:10.0.0.1");
  EXPECT_EQ(PeerHost("ipv6:%5B::1%5D:123"), "ipv6:%5B::1%5D");
  EXPECT_EQ(PeerHost("unix:/tmp/a:b"), "unix:/tmp/a:b");
}

TEST(EstimateParticles, AddsUpWhatTheMessageTells) {
  v1::Scene scene;
  scene.add_bodies()->mutable_icosphere()->set_subdivisions(1);
  EXPECT_EQ(EstimateParticles(scene), 42u);
  v1::Sheet* sheet = scene.add_bodies()->mutable_sheet();
  sheet->set_columns(3);
  sheet->set_rows(4);
  EXPECT_EQ(EstimateParticles(scene), 54u);
}

}  // namespace
}  // namespace adhesim
