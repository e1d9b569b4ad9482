#include "server/web/client_connection.h"

#include <gtest/gtest.h>

#include <atomic>

#include "server/errors.h"
#include "tests/support/web_client.h"
#include "web_fixture.h"

namespace adhesim {
namespace {

using test::ReasonIn;

// One client's connection, without a socket.
class ClientConnectionTest : public WebTest {
 protected:
  ClientConnectionTest()
      : client_(std::make_shared<ClientConnection>(&context_, &calls_, "ipv4:127.0.0.1:1",
                                                   [this] { ++wakes_; })) {}
  ~ClientConnectionTest() override { client_->Leave(); }

  absl::Status Send(const v1::ClientMessage& message) {
    return client_->Receive(message.SerializeAsString());
  }
  // A request without contents on a stream: Request(&v1::ClientMessage::mutable_list_sessions).
  template <typename Member>
  v1::ClientMessage Request(std::uint32_t stream, Member member) {
    v1::ClientMessage message;
    message.set_stream(stream);
    (message.*member)();
    return message;
  }
  v1::ClientMessage Watch(std::uint32_t stream, const std::string& session) {
    v1::ClientMessage message;
    message.set_stream(stream);
    message.mutable_watch()->mutable_start()->set_session(session);
    return message;
  }
  v1::ClientMessage Take(std::uint32_t stream, const std::string& session) {
    v1::ClientMessage message;
    message.set_stream(stream);
    message.mutable_interact()->mutable_take_control()->set_session(session);
    message.mutable_interact()->mutable_take_control()->set_tool("needle");
    return message;
  }
  v1::ClientMessage End(std::uint32_t stream) {
    return Request(stream, &v1::ClientMessage::mutable_end);
  }

  std::optional<v1::ServerMessage> Next() {
    ClientConnection::Outgoing outgoing;
    if (!client_->Next(&outgoing)) return std::nullopt;
    v1::ServerMessage message;
    EXPECT_TRUE(message.ParseFromString(outgoing.head + (outgoing.shared ? *outgoing.shared : "") +
                                        outgoing.tail));
    return message;
  }
  // The next message that is no part of watching or interacting.
  v1::ServerMessage Answer() {
    std::optional<v1::ServerMessage> message;
    WaitFor([&] {
      message = Next();
      return message && !message->has_watch() && !message->has_interact();
    });
    return message.value_or(v1::ServerMessage());
  }
  std::string ReasonOfAnswer() { return ReasonIn(Answer().ended()); }

  std::shared_ptr<ClientConnection> client_;
  std::atomic<int> wakes_{0};
};

TEST_F(ClientConnectionTest, EndsItselfWhenAMessageMeansNothing) {
  EXPECT_EQ(ReasonOf(client_->Receive("\xff\xff\xff")), "ARGUMENT_INVALID");
  EXPECT_EQ(ReasonOf(Send(Request(0, &v1::ClientMessage::mutable_list_sessions))),
            "ARGUMENT_INVALID");
  v1::ServerMessage farewell;
  ASSERT_TRUE(
      farewell.ParseFromString(ClientConnection::Farewell(Error(Reason::kMessageTooLarge, "no"))));
  EXPECT_EQ(farewell.stream(), 0u);
  EXPECT_EQ(ReasonIn(farewell.ended()), "MESSAGE_TOO_LARGE");
}

TEST_F(ClientConnectionTest, TellsOnItsStreamWhatIsWrongWithIt) {
  const std::string id = Create(true);
  v1::ClientMessage empty;
  empty.set_stream(1);
  ASSERT_TRUE(Send(empty).ok());
  EXPECT_EQ(ReasonOfAnswer(), "ARGUMENT_INVALID");
  ASSERT_TRUE(Send(Watch(2, "s9-none")).ok());
  EXPECT_EQ(ReasonOfAnswer(), "SESSION_NOT_FOUND");
  v1::ClientMessage early;
  early.set_stream(7);
  early.mutable_watch()->mutable_ack()->set_frames(1);
  ASSERT_TRUE(Send(early).ok());
  EXPECT_EQ(ReasonOfAnswer(), "STREAM_NOT_STARTED");
  v1::ClientMessage large = Watch(8, std::string(70'000, 'x'));
  ASSERT_TRUE(Send(large).ok());
  EXPECT_EQ(ReasonOfAnswer(), "MESSAGE_TOO_LARGE");
  ASSERT_TRUE(Send(Take(9, id)).ok());
  ASSERT_TRUE(Send(Take(9, id)).ok());
  EXPECT_EQ(ReasonOfAnswer(), "STREAM_STARTED_TWICE");
  EXPECT_TRUE(Describe(id).operated_tools().empty());
}

TEST_F(ClientConnectionTest, EndsAStreamWhoseNumberIsUsedForAnotherCall) {
  const std::string id = Create(true);
  ASSERT_TRUE(Send(Watch(5, id)).ok());
  EXPECT_EQ(Describe(id).viewers(), 1u);
  ASSERT_TRUE(Send(Take(5, id)).ok());
  EXPECT_EQ(ReasonOfAnswer(), "STREAM_IN_USE");
  EXPECT_EQ(Describe(id).viewers(), 0u);
  // The number is free again, now.
  ASSERT_TRUE(Send(Take(5, id)).ok());
  EXPECT_EQ(Describe(id).operated_tools_size(), 1);
  ASSERT_TRUE(Send(Request(5, &v1::ClientMessage::mutable_list_sessions)).ok());
  EXPECT_EQ(ReasonOfAnswer(), "STREAM_IN_USE");
  EXPECT_EQ(Describe(id).operated_tools_size(), 0);
}

TEST_F(ClientConnectionTest, IgnoresWhatWasSentBeforeTheClientKnewOfAnEnd) {
  const std::string id = Create(true);
  ASSERT_TRUE(Send(Watch(5, id)).ok());
  ASSERT_TRUE(Send(End(5)).ok());
  const v1::ServerMessage ended = Answer();
  EXPECT_EQ(ended.stream(), 5u);
  EXPECT_EQ(ended.ended().code(), 0);
  v1::ClientMessage late;
  late.set_stream(5);
  late.mutable_watch()->mutable_ack()->set_frames(1);
  ASSERT_TRUE(Send(late).ok());
  ASSERT_TRUE(Send(End(5)).ok());
  ASSERT_TRUE(Send(Request(6, &v1::ClientMessage::mutable_list_sessions)).ok());
  EXPECT_EQ(Answer().stream(), 6u);  // nothing came before it
}

TEST_F(ClientConnectionTest, LimitsItsStreams) {
  const std::string id = Create(true);
  const std::uint32_t limit = ClientConnection::kMaxStreams;
  for (std::uint32_t stream = 1; stream <= limit; ++stream) {
    ASSERT_TRUE(Send(Watch(stream, id)).ok());
  }
  EXPECT_EQ(Describe(id).viewers(), limit);
  ASSERT_TRUE(Send(Watch(99, id)).ok());
  const v1::ServerMessage refusal = Answer();
  EXPECT_EQ(refusal.stream(), 99u);
  EXPECT_EQ(ReasonIn(refusal.ended()), "TOO_MANY_STREAMS");
  ASSERT_TRUE(Send(End(3)).ok());
  ASSERT_TRUE(Send(Watch(99, id)).ok());
  EXPECT_EQ(Describe(id).viewers(), limit);
}

TEST_F(ClientConnectionTest, RefusesRequestsWhenTooManyAnswersAreNotRead) {
  const std::uint32_t limit = ClientConnection::kMaxCalls;
  std::uint32_t stream = 0;
  absl::Status status;
  while (status.ok() && stream < 10 * limit) {
    status = Send(Request(++stream, &v1::ClientMessage::mutable_list_sessions));
  }
  // Two of a kind: so many answers, and as many refusals.
  EXPECT_EQ(stream, 2 * limit + 1);
  EXPECT_EQ(ReasonOf(status), "TOO_MANY_REQUESTS");
  for (std::uint32_t i = 1; i <= 2 * limit; ++i) {
    const v1::ServerMessage answer = Answer();
    EXPECT_EQ(answer.stream(), i);
    EXPECT_EQ(answer.has_list_sessions(), i <= limit);
    EXPECT_EQ(ReasonIn(answer.ended()), i <= limit ? "" : "TOO_MANY_REQUESTS");
  }
}

TEST_F(ClientConnectionTest, LetsGoOfEverythingWhenTheClientIsGone) {
  const std::string id = Create(false);
  ASSERT_TRUE(Send(Watch(1, id)).ok());
  ASSERT_TRUE(Send(Take(2, id)).ok());
  ASSERT_TRUE(Send(Request(3, &v1::ClientMessage::mutable_list_scenes)).ok());
  v1::ClientMessage create = Request(4, &v1::ClientMessage::mutable_create_session);
  create.mutable_create_session()->set_scene_name("fake");
  ASSERT_TRUE(Send(create).ok());
  client_->Leave();
  EXPECT_EQ(Describe(id).viewers(), 0u);
  EXPECT_TRUE(Describe(id).operated_tools().empty());
  EXPECT_EQ(context_.streams.total(), 0u);
  const int wakes = wakes_;
  // A session that nobody would know of is deleted again (unless its answer was there already).
  WaitFor([&] { return sessions_.List().size() <= 2; });
  SleepUntil(MonotonicNs() + 50'000'000);
  EXPECT_EQ(wakes_, wakes);
}

TEST_F(ClientConnectionTest, HoldsNoMoreThanItsCreditsForAClientThatDoesNotRead) {
  const std::string id = Create(true);
  v1::ClientMessage watch = Watch(1, id);
  watch.mutable_watch()->mutable_start()->set_max_rate_hz(1000);
  watch.mutable_watch()->mutable_start()->set_credits(3);
  ASSERT_TRUE(Send(watch).ok());
  ASSERT_TRUE(Send(Take(2, id)).ok());
  const auto live = *sessions_.Find(id);
  std::atomic<int> done{0};
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(
        live->session
            ->Submit(Session::CommandKind::kStep, 3, [&done](const absl::Status&) { ++done; })
            .ok());
    WaitFor([&] { return done == i + 1; });
  }
  int frames = 0, feedback = 0, other = 0;
  while (const auto message = Next()) {
    const bool is_frame = message->has_watch() && message->watch().has_frame();
    const bool is_feedback = message->has_interact() && message->interact().has_feedback();
    ++(is_frame ? frames : is_feedback ? feedback : other);
  }
  EXPECT_EQ(frames, 3);
  EXPECT_EQ(feedback, 1);
  // Topology, control taken, and a heartbeat of either kind; a heartbeat may come in between.
  EXPECT_LE(other, 6);
}

}  // namespace
}  // namespace adhesim
