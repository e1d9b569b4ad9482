#include "server/recording/replay.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <future>

#include "adhesim/v1/recording.pb.h"
#include "adhesim/v1/view_service.pb.h"
#include "server/recording/recorder.h"
#include "server/session.h"
#include "tests/recording/recording_files.h"
#include "tests/recording/replay_fixture.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"

namespace adhesim {
namespace {

using test::RecordInto;
using test::TempPath;
using test::Verify;

class NoObserver : public SessionObserver {
 public:
  void OnFrame(const SessionFrame&, bool) override {}
  void OnHeartbeat(const SessionFrame&) override {}
  void OnEnd(const absl::Status&) override {}
};

// Passes everything on, and keeps the hash of the newest state.
class HashKeeper : public StepObserver {
 public:
  explicit HashKeeper(std::shared_ptr<Recorder> recorder) : recorder_(std::move(recorder)) {}
  void OnStep(const Engine& engine, std::span<const ToolInput> inputs, const SessionFrame& frame,
              bool may_wait) noexcept override {
    hash_ = engine.StateHash();
    if (recorder_) recorder_->OnStep(engine, inputs, frame, may_wait);
  }
  void OnReset(const SessionFrame& frame) noexcept override {
    if (recorder_) recorder_->OnReset(frame);
  }
  void OnState(v1::SessionState state) noexcept override {
    if (recorder_) recorder_->OnState(state);
  }
  void OnEnd() noexcept override {
    if (recorder_) recorder_->OnEnd();
  }
  std::uint64_t hash() const { return hash_; }

 private:
  std::shared_ptr<Recorder> recorder_;
  std::uint64_t hash_ = 0;
};

// A session with a needle, driven like an operator would.
class DrivenSession {
 public:
  // Records when `path` is not empty.
  explicit DrivenSession(const std::string& path)
      : DrivenSession(path, test::EngineOf(test::NeedleScene(test::kPressAndPull))) {}
  // `cost`: what steps are said to take, s, to a governor with a budget of kBudgetS.
  static constexpr double kBudgetS = 1e-3;
  DrivenSession(const std::string& path, std::unique_ptr<Engine> engine,
                std::function<double(double)> cost = nullptr) {
    keeper_ = std::make_shared<HashKeeper>(path.empty() ? nullptr : RecordInto(path, *engine));
    Session::Options options;
    options.realtime = false;
    options.paused = true;
    options.step_observer = keeper_;
    options.step_budget_s = kBudgetS;
    options.step_cost = std::move(cost);
    session_ = std::make_unique<Session>(std::move(engine), options, &nobody_);
  }

  void Do(Session::CommandKind kind, std::uint32_t steps = 0) {
    std::promise<absl::Status> answer;
    const absl::Status submitted = session_->Submit(
        kind, steps, [&answer](const absl::Status& status) { answer.set_value(status); });
    ASSERT_TRUE(submitted.ok()) << submitted;
    ASSERT_TRUE(answer.get_future().get().ok());
  }
  void Step(int steps) { Do(Session::CommandKind::kStep, steps); }
  // The needle goes in and out once a second, and turns.
  void Drive(int steps) {
    for (int done = 0; done < steps; done += 16) {
      Post(done * 1e-3);
      Step(std::min(16, steps - done));
    }
  }
  void Post(double t_s) {
    OperatorPose pose;
    pose.pose.position_m = Vec3(0.003, 0.002, 0.0475 + 0.0075 * std::cos(2 * M_PI * t_s));
    const double angle = 0.1 * std::sin(3 * t_s);
    pose.pose.orientation = Quat(std::cos(angle / 2), std::sin(angle / 2), 0, 0).normalized();
    session_->PostPose(0, pose);
  }
  // Ends the session; the newest hash.
  std::uint64_t End() {
    session_->Stop(absl::CancelledError("the test is over"));
    return keeper_->hash();
  }

 private:
  NoObserver nobody_;
  std::shared_ptr<HashKeeper> keeper_;
  std::unique_ptr<Session> session_;
};

// Until the tool is retracted; under sanitizers until it holds.
constexpr int kSilentSteps = kSanitized ? 300 : 2600;

// Poses, an operator who falls silent, a reset, and poses again.
std::uint64_t RunScript(const std::string& path, int driven_steps) {
  DrivenSession session(path);
  session.Step(100);  // on its trajectory
  session.Drive(driven_steps);
  session.Step(kSilentSteps);
  session.Drive(200);
  session.Do(Session::CommandKind::kReset);
  session.Do(Session::CommandKind::kReset);
  session.Step(50);
  session.Drive(300);
  return session.End();
}

TEST(Replay, GivesTheSameHashesAsTheSession) {
  const std::string path = TempPath("session.mcap");
  // 5 s and 60 s with the rest of the script.
  const int driven = kSanitized ? 100 : TestSize(1750, 56'750);
  const std::uint64_t hash = RunScript(path, driven);
  for (const int threads : {1, 2}) {
    const ReplayResult result = Verify(path, threads);
    EXPECT_FALSE(result.difference) << "step " << result.difference->index;
    EXPECT_EQ(result.verified, 100u + driven + kSilentSteps + 200 + 50 + 300);
    EXPECT_EQ(result.final_hash, hash);
    EXPECT_FALSE(result.truncated_at);
    EXPECT_TRUE(result.damage.empty());
    EXPECT_GT(result.frames, 60u);
  }
}

// Contacts whose age is their strength, with a reset while they dry.
TEST(Replay, GivesTheSameHashesWhereTheAdhesiveDries) {
  const std::string path = TempPath("drying.mcap");
  const auto engine = [] {
    return test::EngineOf(test::NeedleScene(test::kPressAndPull) +
                          "  - drying: {gain: 2, time_constant_s: 0.1}\n");
  };
  DrivenSession session(path, engine());
  session.Drive(kSanitized ? 130 : 900);
  session.Do(Session::CommandKind::kReset);
  session.Drive(kSanitized ? 130 : 500);
  const std::uint64_t hash = session.End();
  for (const int threads : {1, 2}) {
    const ReplayResult result = Verify(path, threads);
    EXPECT_FALSE(result.difference) << "step " << result.difference->index;
    EXPECT_EQ(result.final_hash, hash);
  }
}

TEST(Replay, GivesTheSameHashesAfterRealTimePausesAndResumes) {
  const std::string path = TempPath("live.mcap");
  std::uint64_t hash = 0;
  {
    DrivenSession session(path);
    for (int round = 0; round < 3; ++round) {
      session.Do(Session::CommandKind::kResume);
      for (int i = 0; i < 20; ++i) {
        session.Post(0.3 + 0.01 * i);
        std::this_thread::sleep_for(std::chrono::milliseconds(7));
      }
      session.Do(Session::CommandKind::kPause);
    }
    hash = session.End();
  }
  const ReplayResult result = Verify(path);
  EXPECT_FALSE(result.difference);
  EXPECT_GT(result.verified, 0u);
  EXPECT_EQ(result.final_hash, hash);
}

// What a study of the scene found.
const std::string kMeasured =
    "rungs:\n"
    "  iterations: {force_error: 0.001, position_error: 2e-7}\n"
    "  detection: {force_error: 0.003, position_error: 4e-7}\n";

// Costs are too high for 0.1 s in every 1.5 s, whatever is given up: down to the last rung, back by
// one and down again.
std::uint64_t RunGoverned(const std::string& path) {
  const auto cost = [step = 0](double) mutable {
    return DrivenSession::kBudgetS * (++step % 1500 < 100 ? 1.5 : 0.2);
  };
  const std::string scene = kMeasured + test::NeedleScene(test::kPressAndPull);
  DrivenSession session(path, test::EngineOf(scene), cost);
  session.Drive(kSanitized ? 130 : 1600);
  session.Do(Session::CommandKind::kReset);
  session.Drive(100);
  return session.End();
}

TEST(Replay, AppliesTheGovernorsDecisionsAndConsultsNoClock) {
  const std::string path = TempPath("governed.mcap");
  const std::uint64_t hash = RunGoverned(path);
  for (const int threads : {1, 2}) {
    const ReplayResult result = Verify(path, threads);
    EXPECT_FALSE(result.difference) << "step " << result.difference->index;
    EXPECT_EQ(result.final_hash, hash);
  }
  std::vector<std::uint32_t> fidelity;
  std::vector<std::string> events;
  int lowered_frames = 0;
  auto reader = *McapReader::Open(path);
  McapMessage message;
  while (*reader->Next(&message)) {
    const std::string& topic = reader->channels().at(message.channel).topic;
    v1::StepInputs inputs;
    v1::Event event;
    if (topic == kInputsTopic) {
      ASSERT_TRUE(inputs.ParseFromArray(message.data.data(), message.data.size()));
      if (inputs.has_fidelity()) fidelity.push_back(inputs.fidelity());
    } else if (topic == kEventsTopic) {
      ASSERT_TRUE(event.ParseFromArray(message.data.data(), message.data.size()));
      if (event.kind() == v1::EVENT_KIND_FIDELITY) events.push_back(event.text());
    } else if (topic == kFramesTopic) {
      v1::WatchResponse update;
      ASSERT_TRUE(update.ParseFromArray(message.data.data(), message.data.size()));
      const v1::FidelityState& state = update.frame().fidelity();
      if (state.rungs() == 0) continue;
      ++lowered_frames;
      EXPECT_TRUE(state.measured());
      EXPECT_EQ(state.expected_force_error(), state.rungs() == 1 ? 0.001 : 0.003);
      EXPECT_EQ(state.expected_position_error(), state.rungs() == 1 ? 2e-7 : 4e-7);
    }
  }
  EXPECT_GT(lowered_frames, 0);
  ASSERT_GE(fidelity.size(), 2u);
  EXPECT_EQ(fidelity[0], 1u);
  EXPECT_EQ(fidelity[1], 2u);
  EXPECT_EQ(events.size(), fidelity.size());  // each change is told
  EXPECT_EQ(events[1], "lowered: iterations, detection");
}

TEST(Replay, RecordingChangesNothing) {
  EXPECT_EQ(RunScript("", 200), RunScript(TempPath("observed.mcap"), 200));
}

// Changes the 100th or a later input by as little as a double can be, with every checksum right:
// only the hash can tell.
TEST(Replay, NamesTheStepOfAChangedInput) {
  const std::string path = TempPath("changed.mcap");
  RunScript(path, 500);
  v1::StepInputs inputs;
  std::uint64_t offset = 0;
  {
    auto reader = *McapReader::Open(path);
    McapMessage message;
    while (*reader->Next(&message)) {
      if (reader->channels().at(message.channel).topic != kInputsTopic) continue;
      ASSERT_TRUE(inputs.ParseFromArray(message.data.data(), message.data.size()));
      offset = message.offset;
      if (inputs.index() >= 100 && inputs.tools(0).has_target()) break;
    }
  }
  v1::Pose* target = inputs.mutable_tools(0)->mutable_target();
  target->set_x_m(std::nextafter(target->x_m(), 1));
  const std::string changed = inputs.SerializeAsString();
  std::string file = test::ReadWholeFile(path);
  file.replace(offset + mcap::kRecordPrefix + mcap::kMessagePrefix, changed.size(), changed);
  test::RepairChecksums(&file);
  test::WriteFile(path, file);

  const ReplayResult result = Verify(path);
  EXPECT_TRUE(result.damage.empty());
  ASSERT_TRUE(result.difference);
  EXPECT_EQ(result.difference->index, inputs.index());
  EXPECT_TRUE(result.difference->expected);
  EXPECT_EQ(result.verified, inputs.index() - 1);

  // With the old checksums, the chunk is said to be damaged as well.
  file[offset + mcap::kRecordPrefix + mcap::kMessagePrefix + 20] ^= 1;
  test::WriteFile(path, file);
  EXPECT_FALSE(Verify(path).damage.empty());
}

// Moves `count` messages of hashes, from the `first` on, to a channel that does not exist; how many
// messages of hashes there were.
int HideHashes(const std::string& path, std::size_t first, std::size_t count) {
  std::vector<std::uint64_t> offsets;
  {
    auto reader = *McapReader::Open(path);
    McapMessage message;
    while (*reader->Next(&message)) {
      const auto channel = reader->channels().find(message.channel);
      if (channel != reader->channels().end() && channel->second.topic == kHashesTopic) {
        offsets.push_back(message.offset);
      }
    }
  }
  std::string file = test::ReadWholeFile(path);
  for (std::size_t i = first; i < std::min(offsets.size(), first + count); ++i) {
    file[offsets[i] + mcap::kRecordPrefix] = 77;
  }
  test::RepairChecksums(&file);
  test::WriteFile(path, file);
  return static_cast<int>(offsets.size());
}

TEST(Replay, NamesTheFirstStepWithoutAHash) {
  const std::string path = TempPath("no_hash.mcap");
  RunScript(path, 100);
  const int messages = HideHashes(path, 0, 1);
  ReplayResult result = Verify(path);
  ASSERT_TRUE(result.difference);
  EXPECT_EQ(result.difference->index, 1u);
  EXPECT_FALSE(result.difference->expected);

  // All of them: nothing is verified, which is not the same as verified.
  HideHashes(path, 0, messages);
  result = Verify(path);
  EXPECT_TRUE(result.damage.empty());
  ASSERT_TRUE(result.difference);
  EXPECT_EQ(result.difference->index, 1u);
  EXPECT_FALSE(result.difference->expected);
  EXPECT_EQ(result.verified, 0u);
}

TEST(Replay, NamesTheFirstStepBehindTheLastHash) {
  const std::string path = TempPath("last_hash.mcap");
  RunScript(path, 100);
  const std::uint64_t steps = Verify(path).verified;
  const int messages = HideHashes(path, 0, 0);
  HideHashes(path, messages - 1, 1);
  const ReplayResult result = Verify(path);
  ASSERT_TRUE(result.difference);
  EXPECT_FALSE(result.difference->expected);
  EXPECT_EQ(result.difference->index, result.verified + 1);
  EXPECT_LT(result.verified, steps);
  // Without its end, the same file may have lost them.
  const std::string file = test::ReadWholeFile(path);
  test::WriteFile(path, file.substr(0, file.size() - 1));
  EXPECT_FALSE(Verify(path).difference);
}

TEST(Replay, ReadsARecordingWhoseWriterWasKilled) {
  const std::string path = TempPath("killed.mcap");
  const pid_t writer = fork();
  ASSERT_GE(writer, 0);
  if (writer == 0) {
    const auto engine = test::EngineOf(test::NeedleScene(test::kPressAndPull));
    const auto recorder = RecordInto(path, *engine);
    SessionFrame frame;
    frame.frame = engine->MakeFrame();
    frame.target_jumps.resize(1);
    frame.newest_pose.resize(1);
    while (true) {
      engine->Step({});
      engine->WriteFrame(&frame.frame);
      recorder->OnStep(*engine, {}, frame, true);
    }
  }
  std::error_code error;
  // The beginning of the file alone is some 20 kB.
  while (std::filesystem::file_size(path, error) < 300'000 || error) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  kill(writer, SIGKILL);
  waitpid(writer, nullptr, 0);
  const ReplayResult result = Verify(path);
  EXPECT_TRUE(result.truncated_at);
  EXPECT_FALSE(result.difference);
  EXPECT_TRUE(result.damage.empty());
  EXPECT_GT(result.verified, 50u);

  // Cut anywhere, it is as good up to there.
  const std::string whole = test::ReadWholeFile(path);
  std::uint64_t before = 0;
  for (std::size_t length = whole.size() / 2; length < whole.size(); length += 40'001) {
    test::WriteFile(path, whole.substr(0, length));
    const ReplayResult part = Verify(path);
    EXPECT_FALSE(part.difference);
    EXPECT_GE(part.verified, before);
    EXPECT_LE(part.verified, result.verified);
    before = part.verified;
  }
}

TEST(Replay, StopsWhenToldTo) {
  const std::string path = TempPath("stop.mcap");
  RunScript(path, 100);
  const std::atomic<bool> stop{true};
  ReplayOptions options;
  options.stop = [&]() -> const std::atomic<bool>& { return stop; };
  const absl::StatusOr<ReplayResult> result = Replay(path, options);
  ASSERT_TRUE(result.ok());
  EXPECT_TRUE(result->interrupted);
  EXPECT_EQ(result->steps, 0u);
}

}  // namespace
}  // namespace adhesim
