#include <gtest/gtest.h>

#include "test_server.h"

namespace adhesim {
namespace {

using ViewServiceTest = ServerTest;

TEST_F(ViewServiceTest, SendsTopologyThenFramesWithSessionStepAndTime) {
  const std::string id = Create(false);
  ViewerClient viewer(view_.get());
  ASSERT_TRUE(viewer.Start(id));
  v1::WatchResponse response;
  ASSERT_TRUE(viewer.stream->Read(&response));
  ASSERT_TRUE(response.has_topology());
  EXPECT_EQ(response.session(), id);
  EXPECT_EQ(response.topology().scene(), "fake");
  EXPECT_EQ(response.topology().rate_hz(), 1000);
  std::uint64_t last = 0;
  for (int i = 0; i < 20; ++i) {
    response = viewer.ReadFrame();
    viewer.Acknowledge();
    EXPECT_EQ(response.session(), id);
    EXPECT_TRUE(i == 0 || response.step() > last);
    EXPECT_NEAR(response.time_s(), response.step() * 1e-3, 1e-12);
    EXPECT_EQ(response.frame().positions().size(), 3u * 3 * 4);
    last = response.step();
  }
}

TEST_F(ViewServiceTest, GivesASlowViewerTheNewestFramesOnlyAndDoesNotDisturbTheOther) {
  const std::string id = Create(false);
  ViewerClient slow(view_.get()), fast(view_.get());
  ASSERT_TRUE(slow.Start(id));
  ASSERT_TRUE(fast.Start(id));
  slow.ReadFrame();
  slow.ReadFrame();  // two credits, not acknowledged
  std::uint64_t fast_step = 0;
  for (int i = 0; i < 300; ++i) {
    fast_step = fast.ReadFrame().step();
    fast.Acknowledge();
  }
  // Nothing has been buffered for the slow one: what it gets next is newer than what the other had
  // by now.
  slow.Acknowledge();
  const v1::WatchResponse next = slow.ReadFrame();
  EXPECT_GE(next.step() + 1, fast_step);
  EXPECT_GT(next.frames_dropped(), 0u);
}

TEST_F(ViewServiceTest, ShowsAPausedSessionAndItsSingleSteps) {
  const std::string id = Create(true);
  ViewerClient viewer(view_.get());
  ASSERT_TRUE(viewer.Start(id));
  EXPECT_EQ(viewer.ReadFrame().step(), 0u);
  viewer.Acknowledge();
  for (std::uint64_t step = 1; step <= 3; ++step) {
    ASSERT_TRUE(Step(id, 1).ok());
    std::uint64_t seen = 0;
    while (seen < step) {
      seen = viewer.ReadFrame().step();
      viewer.Acknowledge();
    }
    EXPECT_EQ(seen, step);
  }
}

TEST_F(ViewServiceTest, RefusesImpossibleWishes) {
  const std::string id = Create(true);
  const auto refusal = [&](const auto& change) {
    v1::WatchRequest request;
    request.mutable_start()->set_session(id);
    change(request.mutable_start());
    ViewerClient viewer(view_.get());
    viewer.stream->Write(request);
    const grpc::Status status = viewer.Finish();
    return ReasonIn(status);
  };
  EXPECT_EQ(refusal([](v1::WatchStart* start) { start->set_session("s9"); }), "SESSION_NOT_FOUND");
  EXPECT_EQ(refusal([](v1::WatchStart* start) { start->set_max_rate_hz(0); }), "ARGUMENT_INVALID");
  EXPECT_EQ(refusal([](v1::WatchStart* start) { start->set_credits(9); }), "ARGUMENT_INVALID");
  EXPECT_EQ(refusal([](v1::WatchStart* start) { start->set_encoding(v1::PositionEncoding(7)); }),
            "ARGUMENT_INVALID");
  ViewerClient hasty(view_.get());
  hasty.Acknowledge();
  EXPECT_EQ(ReasonIn(hasty.Finish()), "STREAM_NOT_STARTED");
  ViewerClient large(view_.get());
  large.Start(std::string(70'000, 'x'));
  EXPECT_EQ(ReasonIn(large.Finish()), "MESSAGE_TOO_LARGE");
}

TEST_F(ViewServiceTest, ForgetsAViewerThatIsGone) {
  const std::string id = Create(false);
  {
    ViewerClient viewer(view_.get());
    ASSERT_TRUE(viewer.Start(id));
    viewer.ReadFrame();
    EXPECT_EQ(Get(id).viewers(), 1u);
    viewer.context.TryCancel();
    viewer.Finish();
  }
  WaitFor(id, [](const v1::Session& now) { return now.viewers() == 0; });
}

TEST_F(ViewServiceTest, EndsWhenItsSessionFreezes) {
  const std::string id = Create(true, "freezes");
  ViewerClient viewer(view_.get());
  ASSERT_TRUE(viewer.Start(id));
  viewer.ReadFrame();
  ASSERT_TRUE(Step(id, 10).ok());
  const grpc::Status status = viewer.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(ReasonIn(status), "SESSION_FROZEN");
}

}  // namespace
}  // namespace adhesim
