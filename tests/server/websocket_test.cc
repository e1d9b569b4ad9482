#include <gtest/gtest.h>

#include <thread>

#include "server/errors.h"
#include "tests/support/web_client.h"
#include "web_fixture.h"

namespace adhesim {
namespace {

using test::ReasonIn;
using test::WebSocketClient;

class WebSocketTest : public WebTest {
 protected:
  explicit WebSocketTest(Limits limits = {}) : WebTest(limits) {}

  static v1::ClientMessage Message(std::uint32_t stream) {
    v1::ClientMessage message;
    message.set_stream(stream);
    return message;
  }
  static v1::ClientMessage Watch(std::uint32_t stream, const std::string& session) {
    v1::ClientMessage message = Message(stream);
    message.mutable_watch()->mutable_start()->set_session(session);
    message.mutable_watch()->mutable_start()->set_max_rate_hz(1000);
    return message;
  }
  static v1::ClientMessage Acknowledge(std::uint32_t stream, std::uint64_t frames) {
    v1::ClientMessage message = Message(stream);
    message.mutable_watch()->mutable_ack()->set_frames(frames);
    return message;
  }
  static v1::ClientMessage Take(std::uint32_t stream, const std::string& session) {
    v1::ClientMessage message = Message(stream);
    message.mutable_interact()->mutable_take_control()->set_session(session);
    message.mutable_interact()->mutable_take_control()->set_tool("needle");
    return message;
  }
  static v1::ClientMessage Pose(std::uint32_t stream, std::uint64_t sequence, double x_m,
                                double qw = 1) {
    v1::ClientMessage message = Message(stream);
    v1::ToolPose* pose = message.mutable_interact()->mutable_pose();
    pose->set_sequence(sequence);
    pose->mutable_pose()->set_x_m(x_m);
    pose->mutable_pose()->set_qw(qw);
    return message;
  }
  static v1::ClientMessage Step(std::uint32_t stream, const std::string& session,
                                std::uint32_t steps) {
    v1::ClientMessage message = Message(stream);
    message.mutable_step_session()->set_session(session);
    message.mutable_step_session()->set_steps(steps);
    return message;
  }
};

TEST_F(WebSocketTest, AcceptsItsSubprotocol) {
  Serve();
  WebSocketClient plain(address_);
  EXPECT_EQ(plain.reply.status, 101);
  EXPECT_EQ(plain.reply.fields.count("Sec-WebSocket-Protocol"), 0u);
  WebSocketClient named(address_, "Sec-WebSocket-Protocol: adhesim.v2.pb, adhesim.v1.pb\r\n");
  EXPECT_EQ(named.reply.fields["Sec-WebSocket-Protocol"], "adhesim.v1.pb");
  WebSocketClient of_its_page(address_, "Origin: http://" + address_ + "\r\n");
  EXPECT_EQ(of_its_page.reply.status, 101);
  WebSocketClient foreign(address_, "Origin: http://example.org\r\n");
  EXPECT_EQ(foreign.reply.status, 403);
  EXPECT_EQ(foreign.reply.body.find("ORIGIN_REFUSED"), 0u);
}

TEST_F(WebSocketTest, AnswersEveryRequestOfASessionsLife) {
  Serve();
  WebSocketClient client(address_);
  v1::ClientMessage message = Message(1);
  message.mutable_list_scenes();
  client.Send(message);
  EXPECT_EQ(client.ReadAnswer(1).list_scenes().scenes(0).name(), "fake");
  message = Message(2);
  message.mutable_create_session()->set_scene_name("fake");
  message.mutable_create_session()->set_paused(true);
  client.Send(message);
  const v1::Session created = client.ReadAnswer(2).create_session().session();
  const std::string id = created.session();
  EXPECT_EQ(created.state(), v1::SESSION_STATE_PAUSED);
  client.Send(Step(3, id, 12));
  const v1::Session stepped = client.ReadAnswer(3).step_session().session();
  EXPECT_EQ(stepped.step(), 12u);
  EXPECT_EQ(stepped.time_s(), Describe(id).time_s());
  message = Message(4);
  message.mutable_resume_session()->set_session(id);
  client.Send(message);
  EXPECT_EQ(client.ReadAnswer(4).resume_session().session().state(), v1::SESSION_STATE_RUNNING);
  client.Send(Step(5, id, 1));
  EXPECT_EQ(ReasonIn(client.ReadAnswer(5).ended()), "SESSION_NOT_PAUSED");
  message = Message(6);
  message.mutable_pause_session()->set_session(id);
  client.Send(message);
  const std::uint64_t paused_at = client.ReadAnswer(6).pause_session().session().step();
  EXPECT_EQ(Describe(id).step(), paused_at);
  message = Message(7);
  message.mutable_reset_session()->set_session(id);
  client.Send(message);
  EXPECT_EQ(client.ReadAnswer(7).reset_session().session().step(), 0u);
  message = Message(8);
  message.mutable_get_session()->set_session(id);
  client.Send(message);
  EXPECT_EQ(client.ReadAnswer(8).get_session().session().session(), id);
  message = Message(9);
  message.mutable_list_sessions();
  client.Send(message);
  EXPECT_EQ(client.ReadAnswer(9).list_sessions().sessions_size(), 1);
  message = Message(10);
  message.mutable_get_server_info();
  client.Send(message);
  EXPECT_EQ(client.ReadAnswer(10).get_server_info().version(), "test");
  message = Message(11);
  message.mutable_list_recordings();
  client.Send(message);
  EXPECT_TRUE(client.ReadAnswer(11).has_list_recordings());
  message = Message(12);
  message.mutable_delete_session()->set_session(id);
  client.Send(message);
  EXPECT_TRUE(client.ReadAnswer(12).has_delete_session());
  EXPECT_TRUE(sessions_.List().empty());
}

TEST_F(WebSocketTest, DrivesAToolAndFeelsIt) {
  Serve();
  const std::string id = Create(false);
  WebSocketClient client(address_);
  client.Send(Take(1, id));
  const v1::ServerMessage taken =
      client.ReadUntil([](const v1::ServerMessage& m) { return m.interact().has_control_taken(); });
  EXPECT_EQ(taken.interact().control_taken().rate_hz(), 1000);
  client.Send(Pose(1, 41, 1e-5));
  const v1::ServerMessage felt = client.ReadUntil([](const v1::ServerMessage& m) {
    return m.interact().has_feedback() && m.interact().feedback().sequence() == 41;
  });
  EXPECT_EQ(felt.stream(), 1u);
  EXPECT_EQ(felt.interact().session(), id);
  EXPECT_EQ(felt.interact().feedback().tool().pose().x_m(), 1e-5);
  EXPECT_EQ(felt.interact().feedback().tool().tissue().fz_n(), 1);
  client.Send(Pose(1, 42, 0, 0.5));
  const v1::ServerMessage refused =
      client.ReadUntil([](const v1::ServerMessage& m) { return m.interact().has_pose_refused(); });
  EXPECT_EQ(refused.interact().pose_refused().reason(), "POSE_NOT_A_ROTATION");
  // A second client watches, and may not drive.
  WebSocketClient second(address_);
  second.Send(Take(1, id));
  EXPECT_EQ(ReasonIn(second.ReadAnswer(1).ended()), "TOOL_TAKEN");
  second.Send(Watch(1, id));
  const v1::ServerMessage heartbeat =
      second.ReadUntil([](const v1::ServerMessage& m) { return m.watch().has_heartbeat(); });
  EXPECT_EQ(heartbeat.watch().heartbeat().viewers(), 1u);
  EXPECT_EQ(heartbeat.watch().heartbeat().operated_tools(0), "needle");
  v1::ClientMessage end = Message(1);
  end.mutable_end();
  client.Send(end);
  EXPECT_EQ(client.ReadAnswer(1).ended().code(), 0);
  second.Send(Take(2, id));
  second.ReadUntil([](const v1::ServerMessage& m) { return m.interact().has_control_taken(); });
}

TEST_F(WebSocketTest, ShowsTopologyThenFramesAsCreditsAllow) {
  Serve();
  const std::string id = Create(true);
  WebSocketClient client(address_);
  client.Send(Watch(7, id));
  const auto is_frame = [](const v1::ServerMessage& m) { return m.watch().has_frame(); };
  std::optional<v1::ServerMessage> first = client.Read();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->stream(), 7u);
  EXPECT_EQ(first->watch().topology().particles(), 3u);
  EXPECT_EQ(client.ReadUntil(is_frame).watch().step(), 0u);
  for (std::uint32_t i = 1; i <= 20; ++i) {
    client.Send(Step(100 + i, id, 1));
    client.ReadAnswer(100 + i);
  }
  // Its second credit went on an early step; no third frame comes, whatever else does.
  client.Send(Acknowledge(7, 1));
  const v1::ServerMessage newest = client.ReadUntil(is_frame);
  EXPECT_EQ(newest.watch().step(), 20u);
  EXPECT_EQ(newest.watch().frame().positions().size(), 3u * 3 * 4);
}

TEST_F(WebSocketTest, KeepsUpWithAFastSessionAndCarriesSeveralStreams) {
  Serve();
  const std::string id = Create(false), other = Create(false);
  WebSocketClient client(address_);
  client.Send(Watch(1, id));
  client.Send(Watch(2, other));
  client.Send(Take(3, id));
  std::map<std::uint32_t, std::uint64_t> frames, steps;
  while (frames[1] < 100 || frames[2] < 100) {
    const v1::ServerMessage message =
        client.ReadUntil([](const v1::ServerMessage& m) { return m.watch().has_frame(); });
    ASSERT_TRUE(message.watch().has_frame());
    EXPECT_EQ(message.watch().session(), message.stream() == 1 ? id : other);
    EXPECT_TRUE(frames[message.stream()] == 0 || message.watch().step() > steps[message.stream()]);
    steps[message.stream()] = message.watch().step();
    client.Send(Acknowledge(message.stream(), ++frames[message.stream()]));
  }
}

TEST_F(WebSocketTest, EndsStreamsWithTheirSession) {
  Serve();
  const std::string id = Create(true, "freezes");
  WebSocketClient client(address_);
  client.Send(Watch(1, id));
  client.Send(Take(2, id));
  client.Send(Step(3, id, 10));
  EXPECT_EQ(ReasonIn(client.ReadAnswer(1).ended()), "SESSION_FROZEN");
  const std::string deleted = Create(true);
  client.Send(Watch(4, deleted));
  client.ReadUntil([](const v1::ServerMessage& m) { return m.watch().has_frame(); });
  ASSERT_TRUE(sessions_.Delete(deleted).ok());
  const v1::ServerMessage ended = client.ReadAnswer(4);
  EXPECT_EQ(ended.ended().code(), static_cast<int>(absl::StatusCode::kAborted));
  EXPECT_EQ(ReasonIn(ended.ended()), "SESSION_DELETED");
}

TEST_F(WebSocketTest, SaysGoodByeWhenTheServerGoesAway) {
  Serve();
  const std::string id = Create(false);
  WebSocketClient client(address_), idle(address_);
  client.Send(Watch(1, id));
  client.ReadUntil([](const v1::ServerMessage& m) { return m.watch().has_frame(); });
  std::thread end([this] {
    sessions_.StopAll(Error(Reason::kDraining, "the server is going away"));
    web_->Stop();
  });
  EXPECT_EQ(ReasonIn(client.ReadAnswer(1).ended()), "DRAINING");
  EXPECT_EQ(ReasonIn(client.ReadFarewell()), "DRAINING");
  EXPECT_EQ(client.close_code, 1001);
  EXPECT_EQ(client.close_reason, "DRAINING");
  EXPECT_EQ(ReasonIn(idle.ReadFarewell()), "DRAINING");
  end.join();
}

TEST_F(WebSocketTest, TakesAMessageInFragmentsAndPingsInBetween) {
  Serve();
  WebSocketClient client(address_);
  v1::ClientMessage message = Message(1);
  message.mutable_list_sessions();
  const std::string bytes = message.SerializeAsString();
  client.SendFrame(WebSocketClient::kBinary, bytes.substr(0, 1), false);
  client.SendFrame(WebSocketClient::kPing, "there?");
  client.SendFrame(WebSocketClient::kContinuation, bytes.substr(1), true);
  const auto pong = client.ReadFrame();
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->opcode, WebSocketClient::kPong);
  EXPECT_EQ(pong->payload, "there?");
  EXPECT_TRUE(client.ReadAnswer(1).has_list_sessions());
}

TEST_F(WebSocketTest, TakesALargeScene) {
  Serve();
  WebSocketClient client(address_);
  v1::ClientMessage message = Message(1);
  v1::Scene* scene = message.mutable_create_session()->mutable_scene();
  scene->set_name("mine");
  scene->set_description(std::string(1'000'000, 'x'));
  scene->add_bodies()->set_name("tissue");
  client.Send(message);
  EXPECT_EQ(client.ReadAnswer(1).create_session().session().scene(), "mine");
}

class FewStreamsOverWebTest : public WebSocketTest {
 protected:
  static Limits Few() {
    Limits limits;
    limits.streams_per_peer = 2;
    return limits;
  }
  FewStreamsOverWebTest() : WebSocketTest(Few()) {}
};

TEST_F(FewStreamsOverWebTest, LimitsTheStreamsOfAPeerOverAllItsConnections) {
  Serve();
  const std::string id = Create(true);
  WebSocketClient first(address_), second(address_);
  first.Send(Watch(1, id));
  first.Send(Watch(2, id));
  first.ReadUntil([](const v1::ServerMessage& m) { return m.stream() == 2; });
  second.Send(Watch(1, id));
  EXPECT_EQ(ReasonIn(second.ReadAnswer(1).ended()), "TOO_MANY_STREAMS");
}

}  // namespace
}  // namespace adhesim
