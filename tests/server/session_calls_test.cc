#include "server/session_calls.h"

#include <gtest/gtest.h>

#include <future>
#include <list>

#include "fake_engine.h"
#include "server/errors.h"

namespace adhesim {
namespace {

// Scenes are not built before the test says so.
class SessionCallsTest : public testing::Test {
 protected:
  SessionCallsTest() : may_build_(build_.get_future().share()), sessions_(Source(), {}, false) {}

  SceneSource Source() {
    SceneSource source = FakeScenes();
    source.build = [build = source.build, may = may_build_](const ReadScene& read,
                                                            Problems* problems) {
      may.wait();
      return build(read, problems);
    };
    return source;
  }

  // One call's answer.
  template <typename Request, typename Response>
  struct Call {
    Request request;
    Response response;
    std::promise<absl::Status> promise;
    std::future<absl::Status> status = promise.get_future();
  };
  template <typename AnyCall>
  void Send(const std::string& peer, AnyCall* call) {
    calls_.Handle({peer, [] { return false; }}, call->request, &call->response,
                  [call](const absl::Status& status) { call->promise.set_value(status); });
  }
  using Create = Call<v1::CreateSessionRequest, v1::CreateSessionResponse>;
  Create& SendCreate(const std::string& peer) {
    Create& create = creations_.emplace_back();
    create.request.set_scene_name("fake");
    create.request.set_paused(true);
    Send(peer, &create);
    return create;
  }

  std::promise<void> build_;
  std::shared_future<void> may_build_;
  std::list<Create> creations_;
  Sessions sessions_;
  ServiceContext context_{sessions_, {}};
  SessionCalls calls_{&context_, {}};
};

TEST_F(SessionCallsTest, SlowScenesKeepNothingElseWaiting) {
  constexpr int kPermitted = 8;
  for (int i = 0; i < kPermitted; ++i) SendCreate("ipv4:10.0.0.1:1");
  // One peer's share is used up, whatever its port; another's is not.
  EXPECT_EQ(ReasonOf(SendCreate("ipv4:10.0.0.1:2").status.get()), "TOO_MANY_REQUESTS");
  SendCreate("ipv4:10.0.0.2:1");
  Call<v1::ListScenesRequest, v1::ListScenesResponse> list;
  Send("ipv4:10.0.0.3:1", &list);
  EXPECT_TRUE(list.status.get().ok());
  EXPECT_EQ(list.response.scenes_size(), 2);

  build_.set_value();
  int created = 0;
  for (Create& create : creations_) {
    if (create.status.valid()) created += create.status.get().ok();
  }
  EXPECT_EQ(created, kPermitted + 1);
  // What is done counts no more.
  EXPECT_TRUE(SendCreate("ipv4:10.0.0.1:1").status.get().ok());
}

}  // namespace
}  // namespace adhesim
