#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

#include "fake_engine.h"
#include "server/service_context.h"
#include "server/session_calls.h"
#include "server/web/web_server.h"

namespace adhesim {

// A web server without gRPC in this process, with fake physics unless told otherwise.
class WebTest : public testing::Test {
 protected:
  explicit WebTest(Limits limits = {}, SceneSource scenes = FakeScenes(),
                   RecordingSource recordings = {})
      : sessions_(std::move(scenes), limits, false, std::move(recordings)),
        context_{sessions_, {}},
        calls_(&context_, {"test", RealtimeClass::kPlain, false}) {
    options_.listen = "127.0.0.1:0";
  }

  // To be called by each test, when it has changed options_.
  void Serve() {
    absl::StatusOr<std::unique_ptr<WebServer>> web = WebServer::Start(options_, &context_, &calls_);
    ASSERT_TRUE(web.ok()) << web.status();
    web_ = *std::move(web);
    address_ = web_->address();
  }

  std::string Create(bool paused, const std::string& scene = "fake") {
    v1::CreateSessionRequest request;
    request.set_scene_name(scene);
    request.set_paused(paused);
    std::vector<std::string> warnings;
    const auto live = sessions_.Create(request, "test", &warnings);
    EXPECT_TRUE(live.ok()) << live.status();
    return (*live)->id;
  }

  v1::Session Describe(const std::string& id) { return (*sessions_.Find(id))->Describe(); }

  // Waits until a condition holds.
  template <typename Condition>
  void WaitFor(const Condition& condition) {
    for (int i = 0; i < 3000; ++i) {
      if (condition()) return;
      SleepUntil(MonotonicNs() + 10'000'000);
    }
    ADD_FAILURE() << "it did not happen within 30 s";
  }

  WebServer::Options options_;
  Sessions sessions_;
  ServiceContext context_;
  SessionCalls calls_;
  std::unique_ptr<WebServer> web_;
  std::string address_;
};

}  // namespace adhesim
