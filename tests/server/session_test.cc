#include "server/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>

#include "fake_engine.h"
#include "server/encode.h"
#include "server/errors.h"

namespace adhesim {
namespace {

// Remembers what it saw; read it after the session is gone, or after a command was answered.
class Recorder : public SessionObserver {
 public:
  void OnFrame(const SessionFrame& frame, bool fresh) override {
    if (fresh && frame.frame.step < last.frame.step && frame.frame.step != 0) ++went_back;
    if (fresh) last = frame;
  }
  void OnHeartbeat(const SessionFrame&) override { ++heartbeats; }
  void OnEnd(const absl::Status& why) override { end = why; }

  SessionFrame last;
  int went_back = 0;
  int heartbeats = 0;
  absl::Status end;
};

// An engine that can do without two things.
class LadderEngine : public FakeEngine {
 public:
  using FakeEngine::FakeEngine;
  std::span<const FidelityRung> rungs() const override { return kRungs; }
  void SetFidelity(int rungs) override { fidelity_ = rungs; }
  int fidelity() const override { return fidelity_; }

 private:
  static constexpr FidelityRung kRungs[] = {{"first", 0.01, 1e-4, false},
                                            {"second", 0.03, 2e-4, true}};
  int fidelity_ = 0;
};

// What every step did without, and what its frame said.
class FidelityLog : public StepObserver {
 public:
  struct Entry {
    int rungs;
    SessionFidelity told;
  };
  void OnStep(const Engine& engine, std::span<const ToolInput>, const SessionFrame& frame,
              bool) noexcept override {
    steps.push_back({engine.fidelity(), frame.fidelity});
  }
  void OnReset(const SessionFrame&) noexcept override {}
  void OnState(v1::SessionState) noexcept override {}
  void OnEnd() noexcept override {}
  std::vector<Entry> steps;
};

class SessionTest : public testing::Test {
 protected:
  void Create(bool paused, const std::string& scene = "fake", double rate_hz = 1000) {
    Session::Options options;
    options.realtime = false;
    options.paused = paused;
    session_ = std::make_unique<Session>(std::make_unique<FakeEngine>(FakeModel(scene, rate_hz)),
                                         options, &recorder_);
  }

  // The answer to a command, once it was carried out (or refused).
  absl::Status Do(Session::CommandKind kind, std::uint32_t steps = 0) {
    std::promise<absl::Status> answer;
    const absl::Status submitted = session_->Submit(
        kind, steps, [&answer](const absl::Status& status) { answer.set_value(status); });
    return submitted.ok() ? answer.get_future().get() : submitted;
  }
  absl::Status Step(std::uint32_t steps) { return Do(Session::CommandKind::kStep, steps); }

  const ToolFrame& needle() const { return recorder_.last.frame.tools[0]; }

  Recorder recorder_;
  std::unique_ptr<Session> session_;
};

TEST_F(SessionTest, TakesExactlyTheStepsAskedFor) {
  Create(true);
  ASSERT_TRUE(Step(7).ok());
  EXPECT_EQ(session_->snapshot().step, 7u);
  EXPECT_EQ(recorder_.last.frame.step, 7u);
  EXPECT_EQ(session_->snapshot().state, v1::SESSION_STATE_PAUSED);
  EXPECT_EQ(recorder_.last.captures, 7u);  // one a step: counts survive frames that nobody saw
  EXPECT_EQ(recorder_.went_back, 0);
}

TEST_F(SessionTest, RunsUntilPausedAndResumes) {
  Create(false);
  while (session_->snapshot().step < 20) std::this_thread::yield();
  ASSERT_TRUE(Do(Session::CommandKind::kPause).ok());
  const std::uint64_t step = session_->snapshot().step;
  ASSERT_TRUE(Step(1).ok());  // nothing else stepped meanwhile
  EXPECT_EQ(session_->snapshot().step, step + 1);
  ASSERT_TRUE(Do(Session::CommandKind::kResume).ok());
  while (session_->snapshot().step < step + 20) std::this_thread::yield();
}

TEST_F(SessionTest, RefusesStepsWhileRunningAndUnreasonableNumbers) {
  Create(false);
  EXPECT_EQ(ReasonOf(Step(1)), "SESSION_NOT_PAUSED");
  EXPECT_EQ(ReasonOf(Step(0)), "ARGUMENT_INVALID");
  EXPECT_EQ(ReasonOf(Step(Session::kMaxStepsAtOnce + 1)), "ARGUMENT_INVALID");
}

TEST_F(SessionTest, ResetsToTheStart) {
  Create(true);
  OperatorPose pose;
  session_->PostPose(0, pose);
  ASSERT_TRUE(Step(300).ok());
  EXPECT_TRUE(needle().flags & kToolOperatorLost);
  ASSERT_TRUE(Do(Session::CommandKind::kReset).ok());
  EXPECT_EQ(session_->snapshot().step, 0u);
  EXPECT_EQ(recorder_.last.captures, 0u);
  ASSERT_TRUE(Step(1).ok());
  EXPECT_FALSE(needle().flags & kToolOperatorLost);
}

TEST_F(SessionTest, UsesTheNewestPoseAndEchoesIt) {
  Create(true);
  OperatorPose pose;
  for (int i = 1; i <= 3; ++i) {
    pose.pose.position_m = Vec3(0.1 * i, 0, 0);
    pose.sequence = i;
    EXPECT_EQ(session_->PostPose(0, pose), i > 1);  // the one before was overtaken
  }
  ASSERT_TRUE(Step(1).ok());
  EXPECT_EQ(recorder_.last.newest_pose[0].sequence, 3u);
  EXPECT_EQ(needle().pose.position_m, pose.pose.position_m);
  EXPECT_EQ(recorder_.last.target_jumps[0], 1u);
  ASSERT_TRUE(Step(10).ok());
  EXPECT_EQ(recorder_.last.target_jumps[0], 1u);  // reported once
}

TEST_F(SessionTest, RetractsAToolWhoseOperatorIsSilent) {
  Create(true);
  session_->PostPose(0, OperatorPose{});
  ASSERT_TRUE(Step(250).ok());
  EXPECT_FALSE(needle().flags & kToolOperatorLost);
  ASSERT_TRUE(Step(1).ok());
  EXPECT_TRUE(needle().flags & kToolOperatorLost);
  EXPECT_EQ(needle().tissue.force_n.z(), 1);
  ASSERT_TRUE(Step(2000).ok());
  EXPECT_LT(needle().tissue.force_n.z(), 1);
  EXPECT_FALSE(needle().flags & kToolRetracted);
  ASSERT_TRUE(Step(250).ok());
  EXPECT_TRUE(needle().flags & kToolRetracted);
  EXPECT_EQ(needle().colliding_particles, 0);
  EXPECT_FALSE(recorder_.last.frame.tools[1].flags & kToolOperatorLost);  // nobody's
  session_->PostPose(0, OperatorPose{});
  ASSERT_TRUE(Step(1).ok());
  EXPECT_EQ(needle().flags & (kToolOperatorLost | kToolRetracted), 0u);
}

TEST_F(SessionTest, FreezesOnANonFiniteValueAndSaysSo) {
  Create(true, "freezes");
  ASSERT_TRUE(Step(10).ok());
  EXPECT_EQ(session_->snapshot().state, v1::SESSION_STATE_FROZEN);
  EXPECT_EQ(session_->snapshot().step, FakeEngine::kFreezeStep - 1);  // the last good one
  EXPECT_TRUE(recorder_.last.report_bits & kStepNonFinite);
  EXPECT_EQ(session_->snapshot().frozen_because, "a particle is nowhere");
  EXPECT_THAT(std::string(Step(1).message()), ::testing::HasSubstr("a particle is nowhere"));
  EXPECT_EQ(ReasonOf(Step(1)), "SESSION_FROZEN");
  EXPECT_EQ(ReasonOf(Do(Session::CommandKind::kResume)), "SESSION_FROZEN");
  ASSERT_TRUE(Do(Session::CommandKind::kReset).ok());
  EXPECT_EQ(session_->snapshot().state, v1::SESSION_STATE_PAUSED);
  ASSERT_TRUE(Step(2).ok());
  EXPECT_EQ(session_->snapshot().step, 2u);
}

// Costs that double for some steps: down in the declared order, each change told with its error,
// and back.
TEST_F(SessionTest, LowersFidelityWhenStepsCostTooMuchAndSaysSo) {
  auto log = std::make_shared<FidelityLog>();
  Session::Options options;
  options.realtime = false;
  options.paused = true;
  options.step_observer = log;
  options.step_cost = [log](double) {
    const std::size_t step = log->steps.size();  // this one included
    const double left[] = {1, 0.75, 0.6};
    return 8e-4 * left[log->steps.back().rungs] * (step > 100 && step < 2000 ? 1.4 : 0.6);
  };
  session_ =
      std::make_unique<Session>(std::make_unique<LadderEngine>(FakeModel()), options, &recorder_);
  EXPECT_DOUBLE_EQ(session_->step_budget_s(), 8e-4);
  ASSERT_TRUE(Step(6000).ok());
  std::vector<int> changes;
  int before = 0;
  for (const FidelityLog::Entry& step : log->steps) {
    if (step.rungs != before) changes.push_back(step.rungs);
    before = step.rungs;
    ASSERT_EQ(step.told.rungs, step.rungs);
    ASSERT_EQ(step.told.changes, changes.size());
    if (step.rungs == 0) continue;
    ASSERT_STREQ(step.told.lowered[step.rungs - 1].name, step.rungs == 1 ? "first" : "second");
    // A frame tells the errors of the last one, and whose they are.
    SessionFrame frame = recorder_.last;
    frame.fidelity = step.told;
    v1::Frame told;
    EncodeFrame(frame, {}, &told);
    ASSERT_EQ(told.fidelity().measured(), step.rungs == 2);
    ASSERT_EQ(told.fidelity().expected_force_error(), step.rungs == 1 ? 0.01 : 0.03);
    ASSERT_EQ(told.fidelity().expected_position_error(), step.rungs == 1 ? 1e-4 : 2e-4);
  }
  EXPECT_EQ(changes, (std::vector<int>{1, 2, 1, 0}));
  v1::Frame message;
  EncodeFrame(recorder_.last, {}, &message);
  EXPECT_EQ(message.fidelity().rungs(), 0u);
  EXPECT_EQ(message.fidelity().changes(), 4u);
  EXPECT_FALSE(message.fidelity().measured());
}

TEST_F(SessionTest, TakesStepsWithoutADeadlineAtFullFidelity) {
  Session::Options options;
  options.realtime = false;
  options.paused = true;
  options.step_budget_s = 1e-9;  // no step is as fast
  auto log = std::make_shared<FidelityLog>();
  options.step_observer = log;
  session_ =
      std::make_unique<Session>(std::make_unique<LadderEngine>(FakeModel()), options, &recorder_);
  ASSERT_TRUE(Step(200).ok());
  for (const FidelityLog::Entry& step : log->steps) ASSERT_EQ(step.rungs, 0);
  ASSERT_TRUE(Do(Session::CommandKind::kResume).ok());
  while (session_->snapshot().timing.lowered_rungs < 2) std::this_thread::yield();
  ASSERT_TRUE(Do(Session::CommandKind::kPause).ok());
  ASSERT_TRUE(Do(Session::CommandKind::kReset).ok());
  v1::Frame message;
  EncodeFrame(recorder_.last, {}, &message);
  EXPECT_EQ(message.fidelity().rungs(), 0u);
  EXPECT_EQ(message.fidelity().changes(), 0u);
}

TEST_F(SessionTest, AnswersWaitingCommandsWhenItEnds) {
  Create(true);
  std::promise<absl::Status> answer;
  // Would take minutes: the end must not wait for it.
  std::uint64_t answered_ok = 0;
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(session_
                    ->Submit(Session::CommandKind::kStep, Session::kMaxStepsAtOnce,
                             [&](const absl::Status& status) { answered_ok += status.ok(); })
                    .ok());
  }
  ASSERT_TRUE(session_
                  ->Submit(Session::CommandKind::kPause, 0,
                           [&answer](const absl::Status& status) { answer.set_value(status); })
                  .ok());
  session_->Stop(Error(Reason::kSessionDeleted, "gone"));
  EXPECT_EQ(ReasonOf(answer.get_future().get()), "SESSION_DELETED");
  EXPECT_EQ(ReasonOf(recorder_.end), "SESSION_DELETED");
  // Steps that were not all taken are not said to be.
  EXPECT_EQ(answered_ok, session_->snapshot().step / Session::kMaxStepsAtOnce);
  EXPECT_EQ(ReasonOf(Step(1)), "SESSION_DELETED");
}

TEST_F(SessionTest, RefusesCommandsThatItCannotRemember) {
  Create(true);
  absl::Status status;
  int accepted = 0;
  while (status.ok() && accepted < 1000) {
    status = session_->Submit(Session::CommandKind::kStep, Session::kMaxStepsAtOnce,
                              [](const absl::Status&) {});
    accepted += status.ok();
  }
  EXPECT_EQ(ReasonOf(status), "TOO_MANY_REQUESTS");
  EXPECT_LE(accepted, 64 + 2);  // the queue, and what was taken out of it meanwhile
}

TEST_F(SessionTest, TakesPosesFromAnotherThreadWhileRunning) {
  Create(false, "fake", 5000);
  std::uint64_t overtaken = 0;
  std::thread writer([&] {
    OperatorPose pose;
    for (std::uint64_t i = 1; i <= 20'000; ++i) {
      pose.sequence = i;
      pose.pose.position_m = Vec3::Constant(i * 1e-6);
      overtaken += session_->PostPose(1, pose);
    }
  });
  writer.join();
  ASSERT_TRUE(Do(Session::CommandKind::kPause).ok());
  ASSERT_TRUE(Step(1).ok());
  EXPECT_EQ(recorder_.last.newest_pose[1].sequence, 20'000u);
  EXPECT_EQ(recorder_.last.frame.tools[1].pose.position_m, Vec3::Constant(20'000 * 1e-6));
  EXPECT_EQ(recorder_.went_back, 0);
}

}  // namespace
}  // namespace adhesim
