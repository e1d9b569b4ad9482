#include "server/hub.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "fake_engine.h"
#include "server/errors.h"

namespace adhesim {
namespace {

class FakeOperator : public OperatorSink {
 public:
  void Deliver(const v1::InteractResponse& response) override { received.push_back(response); }
  void End(const absl::Status& why) override { end = why; }
  std::vector<v1::InteractResponse> received;
  absl::Status end;
};

class FakeViewer : public ViewerSink {
 public:
  void Deliver(const SharedBytes& message, std::uint64_t frames_dropped) override {
    bytes.push_back(message);
    dropped = frames_dropped;
    v1::WatchResponse response;
    EXPECT_TRUE(response.ParseFromString(*message));
    if (response.has_frame()) steps.push_back(response.step());
    last = response;
  }
  void DeliverHeartbeat(const SharedBytes&, std::uint64_t) override { ++heartbeats; }
  void End(const absl::Status& why) override { end = why; }
  std::vector<SharedBytes> bytes;
  std::vector<std::uint64_t> steps;
  v1::WatchResponse last;
  std::uint64_t dropped = 0;
  int heartbeats = 0;
  absl::Status end;
};

class HubTest : public testing::Test {
 protected:
  HubTest() : engine_(FakeModel()), hub_("s1", engine_.model()) {
    frame_.frame = engine_.MakeFrame();
    frame_.newest_pose.resize(2);
    frame_.target_jumps.resize(2);
    // As fast as the session steps: the tests here decide when a frame is due.
    every_frame_.max_rate_hz = 1000;
    Show();
  }

  void Show() {
    engine_.WriteFrame(&frame_.frame);
    hub_.OnFrame(frame_, true);
  }
  void Step() {
    const ToolInput inputs[2];
    engine_.Step(inputs);
    Show();
  }

  FakeEngine engine_;
  Hub hub_;
  SessionFrame frame_;
  Hub::ViewerOptions every_frame_;
};

TEST_F(HubTest, SendsTopologyFirstThenTheNewestFrame) {
  Step();
  FakeViewer viewer;
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &viewer).ok());
  hub_.OnFrame(frame_, false);
  ASSERT_EQ(viewer.bytes.size(), 2u);
  v1::WatchResponse first;
  ASSERT_TRUE(first.ParseFromString(*viewer.bytes[0]));
  ASSERT_TRUE(first.has_topology());
  EXPECT_EQ(first.session(), "s1");
  EXPECT_EQ(first.step(), 1u);
  EXPECT_EQ(first.topology().particles(), 3u);
  EXPECT_EQ(first.topology().bodies(0).name(), "tissue");
  EXPECT_EQ(first.topology().tools(0).needle().length_m(), 0.12);
  EXPECT_EQ(first.topology().tools(1).lancet().blade_width_m(), 0.006);
  const std::uint32_t triangle[3] = {0, 1, 2};
  ASSERT_EQ(first.topology().triangles().size(), sizeof(triangle));
  EXPECT_EQ(std::memcmp(first.topology().triangles().data(), triangle, sizeof(triangle)), 0);
  EXPECT_EQ(viewer.steps, std::vector<std::uint64_t>{1});
  hub_.OnFrame(frame_, false);
  EXPECT_EQ(viewer.bytes.size(), 2u);  // it has the newest already
}

TEST_F(HubTest, GivesASlowViewerFewerFramesButNeverOlderOnes) {
  FakeViewer slow, fast;
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &slow).ok());
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &fast).ok());
  hub_.OnFrame(frame_, false);
  for (int i = 1; i <= 100; ++i) {
    hub_.Acknowledge(&fast, fast.steps.size());
    Step();
  }
  EXPECT_EQ(fast.steps.size(), 101u);
  EXPECT_EQ(slow.steps, (std::vector<std::uint64_t>{0, 1}));  // two credits
  hub_.Acknowledge(&slow, 1);
  hub_.OnFrame(frame_, false);
  EXPECT_EQ(slow.steps, (std::vector<std::uint64_t>{0, 1, 100}));  // the newest, none between
  hub_.Acknowledge(&slow, 1);                                      // said before: gives nothing
  Step();
  EXPECT_EQ(slow.steps.size(), 3u);
}

TEST_F(HubTest, CountsTheFramesThatAViewerLost) {
  FakeViewer viewer;
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &viewer).ok());
  // Each frame is later than a period of the viewer.
  for (int i = 0; i < 10; ++i) {
    SleepUntil(MonotonicNs() + 1'100'000);
    Step();
  }
  hub_.Acknowledge(&viewer, 2);
  Step();
  EXPECT_EQ(viewer.steps, (std::vector<std::uint64_t>{1, 2, 11}));
  // Steps 3 to 10 found no credit. The first of them is pending until the next period makes it
  // lost, and steps may come up to a period early.
  EXPECT_GE(viewer.dropped, 6u);
  EXPECT_LE(viewer.dropped, 8u);
}

TEST_F(HubTest, IgnoresAcknowledgementsOfFramesThatWereNeverSent) {
  FakeViewer viewer;
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &viewer).ok());
  Step();
  hub_.Acknowledge(&viewer, UINT64_MAX);
  for (int i = 0; i < 10; ++i) Step();
  EXPECT_EQ(viewer.steps.size(), 1u + 2u);
}

TEST_F(HubTest, SerialisesAFrameOnceForAllViewersOfAnEncoding) {
  FakeViewer a, b, q;
  Hub::ViewerOptions q16 = every_frame_;
  q16.format.positions = v1::POSITION_ENCODING_Q16;
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &a).ok());
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &b).ok());
  ASSERT_TRUE(hub_.AddViewer(q16, &q).ok());
  Step();
  EXPECT_EQ(a.bytes.back().get(), b.bytes.back().get());  // the same memory
  EXPECT_NE(a.bytes.back().get(), q.bytes.back().get());
}

TEST_F(HubTest, WritesPositionsAsFloatsOrAsSixteenBits) {
  FakeViewer f, q;
  Hub::ViewerOptions q16 = every_frame_;
  q16.format.positions = v1::POSITION_ENCODING_Q16;
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &f).ok());
  ASSERT_TRUE(hub_.AddViewer(q16, &q).ok());
  Step();
  float floats[9];
  ASSERT_EQ(f.last.frame().positions().size(), sizeof(floats));
  std::memcpy(floats, f.last.frame().positions().data(), sizeof(floats));
  EXPECT_FLOAT_EQ(floats[3], 0.1f + 1e-6f);
  const v1::Frame& quantised = q.last.frame();
  std::uint16_t values[9];
  ASSERT_EQ(quantised.positions().size(), sizeof(values));
  std::memcpy(values, quantised.positions().data(), sizeof(values));
  for (int i = 0; i < 9; ++i) {
    const double size_m = quantised.box_size_m(i % 3);
    const double position_m = quantised.box_min_m(i % 3) + values[i] / 65535.0 * size_m;
    // Rounded to the nearest of 65536 places, and computed in float.
    EXPECT_NEAR(position_m, floats[i], size_m / 65535 * 0.51 + 1e-8);
  }
  EXPECT_EQ(f.last.frame().box_min_m_size(), 0);
}

TEST_F(HubTest, GivesAToolToOneOperatorOnly) {
  FakeOperator first, second;
  ASSERT_TRUE(hub_.AddOperator("needle", &first).ok());
  EXPECT_EQ(ReasonOf(hub_.AddOperator("needle", &second).status()), "TOOL_TAKEN");
  EXPECT_TRUE(hub_.AddOperator("lancet", &second).ok());
  EXPECT_EQ(hub_.operated_tools(), (std::vector<std::string>{"needle", "lancet"}));
  hub_.RemoveOperator(&first);
  EXPECT_TRUE(hub_.AddOperator("needle", &first).ok());
  FakeOperator third;
  const absl::Status status = hub_.AddOperator("spoon", &third).status();
  EXPECT_EQ(ReasonOf(status), "TOOL_NOT_FOUND");
  EXPECT_EQ(status.message(), "no tool \"spoon\" in session s1; there is needle, lancet");
}

TEST_F(HubTest, TellsAnOperatorWhichOfItsPosesAStepUsed) {
  FakeOperator first;
  const absl::StatusOr<std::uint64_t> id = hub_.AddOperator("needle", &first);
  ASSERT_TRUE(id.ok());
  frame_.newest_pose[0].operator_id = *id;
  frame_.newest_pose[0].sequence = 17;
  frame_.newest_pose[0].client_time_ns = 99;
  Step();
  ASSERT_EQ(first.received.size(), 2u);
  EXPECT_TRUE(first.received[0].has_control_taken());
  EXPECT_EQ(first.received[1].step(), 1u);
  EXPECT_EQ(first.received[1].feedback().sequence(), 17u);
  EXPECT_EQ(first.received[1].feedback().client_time_ns(), 99);
  EXPECT_EQ(first.received[1].feedback().tool().tissue().fz_n(), 1);
  // The next operator does not get the poses of the one before.
  hub_.RemoveOperator(&first);
  FakeOperator second;
  ASSERT_TRUE(hub_.AddOperator("needle", &second).ok());
  Step();
  EXPECT_EQ(second.received.back().feedback().sequence(), 0u);
}

TEST_F(HubTest, EndsEveryStreamOfAFrozenSessionUntilItIsReset) {
  FakeOperator operator_;
  FakeViewer viewer;
  ASSERT_TRUE(hub_.AddOperator("needle", &operator_).ok());
  ASSERT_TRUE(hub_.AddViewer(every_frame_, &viewer).ok());
  frame_.state = v1::SESSION_STATE_FROZEN;
  frame_.frozen_because = "a particle is nowhere";
  hub_.OnFrame(frame_, true);
  EXPECT_EQ(ReasonOf(operator_.end), "SESSION_FROZEN");
  EXPECT_THAT(std::string(operator_.end.message()), ::testing::HasSubstr("a particle is nowhere"));
  EXPECT_EQ(ReasonOf(viewer.end), "SESSION_FROZEN");
  EXPECT_EQ(ReasonOf(hub_.AddViewer(every_frame_, &viewer)), "SESSION_FROZEN");
  EXPECT_EQ(ReasonOf(hub_.AddOperator("needle", &operator_).status()), "SESSION_FROZEN");
  frame_.state = v1::SESSION_STATE_RUNNING;
  hub_.OnFrame(frame_, true);
  EXPECT_TRUE(hub_.AddOperator("needle", &operator_).ok());
}

}  // namespace
}  // namespace adhesim
