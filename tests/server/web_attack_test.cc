// Clients that do what no browser does, beside a session that must not notice: after each attack
// its state has the hash that it has without a server.

#include <gtest/gtest.h>

#include <functional>
#include <thread>

#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"
#include "tests/support/web_client.h"
#include "web_fixture.h"

namespace adhesim {
namespace {

using test::RawConnection;
using test::ReadReply;
using test::ReasonIn;
using test::WebSocketClient;

constexpr int kSteps = 300;

std::shared_ptr<const Model> NeedleModel() {
  static const std::shared_ptr<const Model> model =
      test::ModelOf(test::NeedleScene(test::kPressAndPull));
  return model;
}

// After kSteps, computed once, without a server.
std::uint64_t UndisturbedHash() {
  static const std::uint64_t hash = [] {
    const std::unique_ptr<Engine> engine = test::EngineOf(NeedleModel());
    test::StepMany(engine.get(), kSteps);
    return engine->StateHash();
  }();
  return hash;
}

// A server with real physics, a client whose session steps, and attackers.
class WebAttackTest : public WebTest {
 protected:
  explicit WebAttackTest(Limits limits = {}) : WebTest(limits, NeedleScenes(&engine_)) {
    // Long enough for 17 MB in one message on a busy machine, under a sanitizer.
    options_.patience.write_s = kSanitized ? 6 : 1.5;
    options_.patience.message_s = kSanitized ? 6 : 1.5;
    options_.patience.request_s = 1.5;
    options_.patience.idle_s = 20;  // not by this shall they be ended
    Serve();
    id_ = Create(true, "needle");
  }

  static SceneSource NeedleScenes(const Engine** made) {
    SceneSource source = FakeScenes();
    source.read = [](const std::string& name) -> absl::StatusOr<ReadScene> {
      ReadScene read;
      read.scene.set_name(name);
      return read;
    };
    source.build = [made](const ReadScene&, Problems*) {
      std::unique_ptr<Engine> engine = test::EngineOf(NeedleModel());
      if (*made == nullptr) *made = engine.get();  // of the session that shall not notice
      return engine;
    };
    return source;
  }

  // Steps the session through its client's connection while the attack goes on (on this thread),
  // then compares hashes. The attack returns when it has done its worst; what it holds open stays
  // open until the steps are done.
  void SurvivesBeside(const std::function<void()>& attack) {
    std::thread stepping([this] {
      WebSocketClient client(address_);
      for (int i = 1; i <= kSteps / 10; ++i) {
        v1::ClientMessage message;
        message.set_stream(i);
        message.mutable_step_session()->set_session(id_);
        message.mutable_step_session()->set_steps(10);
        client.Send(message);
        EXPECT_EQ(client.ReadAnswer(i).step_session().session().step(), 10u * i);
      }
    });
    attack();
    stepping.join();
    EXPECT_EQ(Describe(id_).step(), static_cast<std::uint64_t>(kSteps));
    EXPECT_EQ(engine_->StateHash(), UndisturbedHash());
  }

  v1::ClientMessage Watch(std::uint32_t stream) {
    v1::ClientMessage message;
    message.set_stream(stream);
    message.mutable_watch()->mutable_start()->set_session(id_);
    message.mutable_watch()->mutable_start()->set_max_rate_hz(1000);
    message.mutable_watch()->mutable_start()->set_credits(8);
    return message;
  }

  const Engine* engine_ = nullptr;
  std::string id_;
};

// Sends it and says how the connection was ended: "CODE REASON", the reason of the last message if
// there was one.
std::string EndAfter(const std::string& address,
                     const std::function<void(WebSocketClient*)>& attack) {
  WebSocketClient client(address);
  attack(&client);
  const std::string reason = ReasonIn(client.ReadFarewell());
  return std::to_string(client.close_code) + " " + reason;
}

TEST_F(WebAttackTest, MalformedMessagesEndTheirConnectionWithAReason) {
  SurvivesBeside([this] {
    const auto send = [this](int opcode, const std::string& bytes, bool last = true) {
      return EndAfter(address_,
                      [&](WebSocketClient* client) { client->SendFrame(opcode, bytes, last); });
    };
    EXPECT_EQ(send(WebSocketClient::kBinary, "\xff\xff\xff"), "1008 ARGUMENT_INVALID");
    EXPECT_EQ(send(WebSocketClient::kBinary, ""), "1008 ARGUMENT_INVALID");
    EXPECT_EQ(send(WebSocketClient::kText, "hello"), "1008 ARGUMENT_INVALID");
    // What is no WebSocket frame is ended by the protocol's own code.
    EXPECT_EQ(send(3, "reserved"), "1002 ");
    EXPECT_EQ(send(WebSocketClient::kContinuation, "of nothing"), "1002 ");
    EXPECT_EQ(send(WebSocketClient::kPing, "in pieces", false), "1002 ");
    EXPECT_EQ(EndAfter(address_,
                       [](WebSocketClient* client) {
                         client->raw.Send(std::string("\x82\x03xyz", 5));  // not masked
                       }),
              "1002 ");
  });
}

TEST_F(WebAttackTest, OversizedMessagesEndTheirStreamOrConnectionWithAReason) {
  SurvivesBeside([this] {
    WebSocketClient watcher(address_);
    v1::ClientMessage message = Watch(1);
    message.mutable_watch()->mutable_start()->set_session(std::string(100'000, 'x'));
    watcher.Send(message);
    EXPECT_EQ(ReasonIn(watcher.ReadAnswer(1).ended()), "MESSAGE_TOO_LARGE");
    message.mutable_create_session()->mutable_scene()->set_description(std::string(17 << 20, 'x'));
    EXPECT_EQ(EndAfter(address_, [&](WebSocketClient* client) { client->Send(message); }),
              "1009 MESSAGE_TOO_LARGE");
    // A length that cannot be.
    EXPECT_EQ(EndAfter(address_,
                       [](WebSocketClient* client) {
                         std::string header = "\x82\xff\x7f";
                         header += std::string(7, '\xff') + "mask" + std::string(100, 'x');
                         client->raw.Send(header);
                       }),
              "1008 MESSAGE_TOO_SLOW");
  });
}

TEST_F(WebAttackTest, EndlessMessagesAreEnded) {
  SurvivesBeside([this] {
    // In fragments, for as long as it is listened to: ended by size.
    EXPECT_EQ(EndAfter(address_,
                       [](WebSocketClient* client) {
                         client->SendFrame(WebSocketClient::kBinary, "x", false);
                         const std::string piece(60'000, 'x');
                         for (int i = 0; i < 300; ++i) {
                           if (!client->SendFrame(WebSocketClient::kContinuation, piece, false)) {
                             break;
                           }
                         }
                       }),
              "1009 MESSAGE_TOO_LARGE");
    // A little at a time: ended by time.
    EXPECT_EQ(EndAfter(address_,
                       [](WebSocketClient* client) {
                         client->SendFrame(WebSocketClient::kBinary, "x", false);
                         client->SendFrame(WebSocketClient::kContinuation, "x", false);
                       }),
              "1008 MESSAGE_TOO_SLOW");
  });
}

TEST_F(WebAttackTest, FewLargeMessagesAreUnderWayAtATime) {
  SurvivesBeside([this] {
    const std::string large(100'000, 'x');
    std::vector<std::unique_ptr<WebSocketClient>> holders;
    int refused = 0;
    for (int i = 0; i < 6; ++i) {
      holders.push_back(std::make_unique<WebSocketClient>(address_));
      holders.back()->SendFrame(WebSocketClient::kBinary, large, false);
    }
    for (const auto& holder : holders) {
      const std::string reason = ReasonIn(holder->ReadFarewell());
      EXPECT_TRUE(reason == "TOO_MANY_REQUESTS" || reason == "MESSAGE_TOO_SLOW") << reason;
      refused += reason == "TOO_MANY_REQUESTS";
    }
    EXPECT_EQ(refused, 2);  // four at a time are listened to
  });
}

TEST_F(WebAttackTest, AHundredConnectionsThatNeverReadChangeNothing) {
  std::vector<std::unique_ptr<WebSocketClient>> lazy;
  SurvivesBeside([&] {
    for (int i = 0; i < 100; ++i) {
      lazy.push_back(std::make_unique<WebSocketClient>(address_));
      EXPECT_EQ(lazy.back()->reply.status, 101);
      lazy.back()->Send(Watch(1));
    }
    WaitFor([this] { return Describe(id_).viewers() == 100; });
  });
}

TEST_F(WebAttackTest, AClientThatAsksAndNeverReadsIsEnded) {
  SurvivesBeside([this] {
    WebSocketClient lazy(address_);
    const int small = 4096;
    ::setsockopt(lazy.raw.fd(), SOL_SOCKET, SO_RCVBUF, &small, sizeof(small));
    v1::ClientMessage message;
    // The answer repeats the id.
    message.mutable_get_session()->set_session(std::string(8192, 'x'));
    for (std::uint32_t i = 1; i < 1'000'000; ++i) {
      message.set_stream(i);
      if (!lazy.Send(message)) return;  // ended: it may not go on for ever
    }
    ADD_FAILURE() << "a million requests were taken from a client that reads no answer";
  });
}

class FewConnectionsTest : public WebAttackTest {
 protected:
  static Limits Few() {
    Limits limits;
    limits.connections_per_peer = 20;
    return limits;
  }
  FewConnectionsTest() : WebAttackTest(Few()) {}
};

TEST_F(FewConnectionsTest, AFloodOfConnectionsIsRefusedWithAReason) {
  // The client that steps has its own already.
  WebSocketClient own(address_);
  std::vector<std::unique_ptr<RawConnection>> flood;
  SurvivesBeside([&] {
    WaitFor([this] { return Describe(id_).step() > 0; });
    for (int i = 0; i < 200; ++i) flood.push_back(std::make_unique<RawConnection>(address_));
    int refused = 0;
    for (const auto& connection : flood) {
      const test::HttpReply reply = ReadReply(connection.get());
      if (reply.status == 0) continue;  // taken, and ended when it had not asked in time
      EXPECT_EQ(reply.status, 503);
      EXPECT_EQ(reply.body.find("TOO_MANY_CONNECTIONS: "), 0u);
      ++refused;
    }
    EXPECT_GE(refused, 200 - 20);
  });
  flood.clear();
  WaitFor([this] { return test::Get(address_, "/healthz").status == 200; });
}

TEST_F(WebAttackTest, HalfOpenAndSlowConnectionsAreEnded) {
  SurvivesBeside([this] {
    RawConnection silent(address_), slow(address_), half(address_);
    half.Send("GET /v1/ws HTTP/1.1\r\nHost: " + address_ + "\r\nUpgrade: websocket\r\n");
    for (int i = 0; i < 500; ++i) {  // slow loris
      if (!slow.Send("X")) break;
      SleepUntil(MonotonicNs() + 10'000'000);
    }
    EXPECT_EQ(silent.ReadAll(), "");
    EXPECT_EQ(half.ReadAll(), "");
    EXPECT_FALSE(slow.Send("X"));
  });
}

TEST_F(WebAttackTest, ConnectionsMayBreakAtAnyByte) {
  SurvivesBeside([this] {
    v1::ClientMessage create;
    create.set_stream(3);
    create.mutable_create_session()->set_scene_name("needle");
    const std::string handshake =
        "GET /v1/ws HTTP/1.1\r\nHost: " + address_ +
        "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
    for (std::size_t i = 0; i < handshake.size(); i += 7) {
      RawConnection(address_).Send(handshake.substr(0, i));
    }
    for (int i = 0; i < 60; ++i) {
      WebSocketClient client(address_);
      client.Send(Watch(1));
      if (i % 3 == 1) client.Send(create);
      if (i % 3 == 2) client.Read();
      const std::string frame = std::string("\x82\x90mask", 6) + std::string(i % 16, 'x');
      client.raw.Send(frame.substr(0, i % frame.size()));
      if (i % 2 == 0) {  // a reset rather than an end
        const linger at_once{1, 0};
        ::setsockopt(client.raw.fd(), SOL_SOCKET, SO_LINGER, &at_once, sizeof(at_once));
      }
    }
    WaitFor([this] { return Describe(id_).viewers() == 0; });
    EXPECT_EQ(context_.streams.total(), 0u);
  });
}

TEST_F(WebAttackTest, FloodsOfAcknowledgementsAndPingsChangeNothing) {
  SurvivesBeside([this] {
    WebSocketClient client(address_);
    client.Send(Watch(1));
    v1::ClientMessage ack;
    ack.set_stream(1);
    ack.mutable_watch()->mutable_ack()->set_frames(0);
    for (int i = 0; i < 3000; ++i) {
      client.Send(ack);
      client.SendFrame(WebSocketClient::kPing, "");
    }
    v1::ClientMessage last;
    last.set_stream(2);
    last.mutable_list_sessions();
    client.Send(last);
    EXPECT_TRUE(client.ReadAnswer(2).has_list_sessions());
  });
}

}  // namespace
}  // namespace adhesim
