#include "server/recording/recorder.h"

#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>

#include "tests/recording/recording_files.h"
#include "tests/server/fake_engine.h"
#include "tests/support/count_allocations.h"

namespace adhesim {
namespace {

using test::SinkInto;
using test::TempPath;

// A disk that can be stopped.
class Disk {
 public:
  ByteSink sink() {
    return [this](std::string_view bytes) {
      std::unique_lock lock(mutex_);
      waiting_ = stopped_;
      changed_.notify_all();
      changed_.wait(lock, [this] { return !stopped_; });
      waiting_ = false;
      bytes_.append(bytes);
      return absl::OkStatus();
    };
  }
  void Stop() { Set(true); }
  void Go() { Set(false); }
  bool waiting() {
    const std::lock_guard lock(mutex_);
    return waiting_;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void Set(bool stopped) {
    const std::lock_guard lock(mutex_);
    stopped_ = stopped;
    changed_.notify_all();
  }
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopped_ = false, waiting_ = false;
  std::string bytes_;
};

// Frames with room for zones and contact forces, like those of the real one.
class RoomyEngine : public FakeEngine {
 public:
  using FakeEngine::FakeEngine;
  Frame MakeFrame() const override {
    Frame frame = FakeEngine::MakeFrame();
    frame.zones.reserve(3);
    frame.contact_forces.reserve(3);
    return frame;
  }
};

// The fake engine, seen as a session shows it to a recorder.
class FakeRun {
 public:
  explicit FakeRun(const std::string& scene = "fake") : engine_(FakeModel(scene)), inputs_(2) {
    frame_.frame = engine_.MakeFrame();
    frame_.newest_pose.resize(2);
    frame_.target_jumps.resize(2);
  }
  void Step(Recorder* recorder, bool may_wait = false) {
    const StepReport report = engine_.Step(inputs_);
    engine_.WriteFrame(&frame_.frame);
    frame_.frame.report = report;
    recorder->OnStep(engine_, inputs_, frame_, may_wait);
  }
  void Reset(Recorder* recorder) {
    engine_.Reset();
    engine_.WriteFrame(&frame_.frame);
    recorder->OnReset(frame_);
  }
  Engine& engine() { return engine_; }
  ToolInput& needle() { return inputs_[0]; }
  SessionFrame& frame() { return frame_; }

 private:
  RoomyEngine engine_;
  std::vector<ToolInput> inputs_;
  SessionFrame frame_;
};

const RecordingAbout kAbout{"1.2.3", "test build", "s1", "fake", 1000, 7};

// All that a recording holds.
struct Recorded {
  std::vector<v1::StepInputs> inputs;
  std::vector<v1::Event> events;
  std::vector<std::uint64_t> hashes;  // of steps 1, 2, ..
  std::vector<v1::WatchResponse> frames, topologies;
  std::vector<v1::ToolForces> forces;
  std::vector<std::uint64_t> times;
  std::optional<std::uint64_t> truncated_at;

  bool Has(v1::EventKind kind) const {
    for (const v1::Event& event : events) {
      if (event.kind() == kind) return true;
    }
    return false;
  }
};

Recorded ReadRecorded(const std::string& bytes) {
  test::WriteFile(TempPath("recorder"), bytes);
  auto reader = McapReader::Open(TempPath("recorder"));
  EXPECT_TRUE(reader.ok()) << reader.status();
  Recorded recorded;
  McapMessage message;
  const auto parse = [&message](auto* out) {
    EXPECT_TRUE(out->ParseFromArray(message.data.data(), static_cast<int>(message.data.size())));
  };
  while (*(*reader)->Next(&message)) {
    const std::string& topic = (*reader)->channels().at(message.channel).topic;
    recorded.times.push_back(message.log_time);
    if (topic == kInputsTopic) parse(&recorded.inputs.emplace_back());
    if (topic == kEventsTopic) parse(&recorded.events.emplace_back());
    if (topic == kFramesTopic) parse(&recorded.frames.emplace_back());
    if (topic == kTopologyTopic) parse(&recorded.topologies.emplace_back());
    if (topic == kForcesTopic) parse(&recorded.forces.emplace_back());
    if (topic == kHashesTopic) {
      v1::StateHashes hashes;
      parse(&hashes);
      EXPECT_EQ(hashes.first_index(), recorded.hashes.size() + 1);
      recorded.hashes.insert(recorded.hashes.end(), hashes.hashes().begin(), hashes.hashes().end());
    }
  }
  recorded.truncated_at = (*reader)->truncated_at();
  EXPECT_TRUE((*reader)->damage().empty());
  EXPECT_TRUE(std::is_sorted(recorded.times.begin(), recorded.times.end()));
  return recorded;
}

Pose PoseAt(double x_m) { return {Vec3(x_m, 0, 0), Quat::Identity()}; }

TEST(Recorder, KeepsOnlyChangesOfInputsAndAHashOfEveryStep) {
  std::string bytes;
  FakeRun run;
  Recorder recorder(SinkInto(&bytes), {}, kAbout, {}, run.engine());
  for (int step = 1; step <= 100; ++step) {
    if (step == 10) {
      run.needle().has_target = true;
      run.needle().target = PoseAt(0.1);
    }
    if (step == 50) run.needle().strength_scale = 0.5;
    run.Step(&recorder);
  }
  run.Reset(&recorder);
  run.needle() = ToolInput{};
  run.Step(&recorder);
  recorder.OnEnd();
  EXPECT_TRUE(recorder.status().ok());

  const Recorded recorded = ReadRecorded(bytes);
  EXPECT_FALSE(recorded.truncated_at);
  ASSERT_EQ(recorded.inputs.size(), 3u);
  EXPECT_EQ(recorded.inputs[0].index(), 10u);
  EXPECT_EQ(recorded.inputs[0].tools(0).target().x_m(), 0.1);
  EXPECT_FALSE(recorded.inputs[0].tools(0).has_strength_scale());
  EXPECT_EQ(recorded.inputs[1].index(), 50u);
  EXPECT_EQ(recorded.inputs[1].tools(0).strength_scale(), 0.5);
  EXPECT_EQ(recorded.inputs[2].index(), 101u);
  EXPECT_TRUE(recorded.inputs[2].reset());
  EXPECT_EQ(recorded.inputs[2].tools_size(), 0);  // none differs from a tool without an operator
  ASSERT_EQ(recorded.hashes.size(), 101u);
  EXPECT_EQ(recorded.hashes[99], 100u);  // the fake engine's hash is its step
  EXPECT_EQ(recorded.hashes[100], 1u);
  EXPECT_EQ(recorded.forces.size(), 101u);
  EXPECT_EQ(recorded.topologies.size(), 1u);
  // The start, 60 a second in 0.101 s, and the start again.
  EXPECT_EQ(recorded.frames.size(), 1u + 6u + 1u);
  EXPECT_TRUE(recorded.Has(v1::EVENT_KIND_RESET));
  EXPECT_TRUE(recorded.Has(v1::EVENT_KIND_CAPTURE));
}

TEST(Recorder, SaysPauseResumeLossAndFreezing) {
  std::string bytes;
  FakeRun run("freezes");
  Recorder recorder(SinkInto(&bytes), {}, kAbout, {}, run.engine());
  run.Step(&recorder);
  recorder.OnState(v1::SESSION_STATE_PAUSED);
  recorder.OnState(v1::SESSION_STATE_RUNNING);
  for (std::uint64_t step = 2; step <= FakeEngine::kFreezeStep; ++step) run.Step(&recorder);
  recorder.OnEnd();
  const Recorded recorded = ReadRecorded(bytes);
  EXPECT_TRUE(recorded.Has(v1::EVENT_KIND_PAUSED));
  EXPECT_TRUE(recorded.Has(v1::EVENT_KIND_RESUMED));
  EXPECT_TRUE(recorded.Has(v1::EVENT_KIND_FROZEN));
  ASSERT_EQ(recorded.hashes.size(), FakeEngine::kFreezeStep);
  EXPECT_EQ(recorded.hashes.back(), 0u);  // a frozen state has no hash
}

// A disk that stops for a while: frames are left out, nothing else is, and no step waits.
TEST(Recorder, LosesNoInputToASlowDisk) {
  Disk disk;
  FakeRun run;
  Recorder recorder(disk.sink(), {}, kAbout, {}, run.engine());
  disk.Stop();
  constexpr int kSteps = 3900;  // just less than four seconds
  run.needle().has_target = true;
  for (int step = 1; step <= kSteps; ++step) {
    run.needle().target = PoseAt(1e-4 * step);
    run.Step(&recorder);  // returns although the disk stands still: or this test would hang
  }
  disk.Go();
  recorder.OnEnd();
  EXPECT_TRUE(recorder.status().ok()) << recorder.status();
  const Recorded recorded = ReadRecorded(disk.bytes());
  ASSERT_EQ(recorded.inputs.size(), std::size_t{kSteps});
  EXPECT_EQ(recorded.inputs.back().tools(0).target().x_m(), 1e-4 * kSteps);
  EXPECT_EQ(recorded.hashes.size(), std::size_t{kSteps});
  EXPECT_TRUE(recorded.Has(v1::EVENT_KIND_FRAMES_DROPPED));
  EXPECT_LT(recorded.frames.size(), 60u);
}

TEST(Recorder, EndsWithAnEventWhenTheDiskStaysAway) {
  Disk disk;
  FakeRun run;
  std::vector<std::string> warnings;
  Recorder::Options options;
  options.warn = [&warnings](const std::string& what) { warnings.push_back(what); };
  Recorder recorder(disk.sink(), options, kAbout, {}, run.engine());
  disk.Stop();
  for (int step = 1; step <= 20'000; ++step) run.Step(&recorder);
  disk.Go();
  recorder.OnEnd();
  EXPECT_FALSE(recorder.status().ok());
  EXPECT_EQ(warnings.size(), 1u);
  const Recorded recorded = ReadRecorded(disk.bytes());
  EXPECT_TRUE(recorded.Has(v1::EVENT_KIND_TRUNCATED));
  EXPECT_GE(recorded.hashes.size(), 4000u);
  EXPECT_LT(recorded.hashes.size(), 20'000u);
  EXPECT_FALSE(recorded.truncated_at);  // the file itself is whole
}

// Steps without a deadline may wait for the disk, and then nothing at all is left out.
TEST(Recorder, LosesNothingWhenStepsMayWait) {
  std::string bytes;
  FakeRun run;
  Recorder::Options options;
  options.buffer_s = 0.064;
  options.buffered_frames = 2;
  Recorder recorder(SinkInto(&bytes), options, kAbout, {}, run.engine());
  for (int step = 1; step <= 20'000; ++step) run.Step(&recorder, true);
  recorder.OnEnd();
  EXPECT_TRUE(recorder.status().ok()) << recorder.status();
  const Recorded recorded = ReadRecorded(bytes);
  EXPECT_EQ(recorded.hashes.size(), 20'000u);
  EXPECT_EQ(recorded.frames.size(), 1u + 1200u);
}

TEST(Recorder, TellsOfAFullDiskOnceAndGoesOn) {
  FakeRun run;
  std::vector<std::string> warnings;
  Recorder::Options options;
  options.warn = [&warnings](const std::string& what) { warnings.push_back(what); };
  std::size_t left = 20'000;
  Recorder recorder(
      [&left](std::string_view bytes) {
        if (bytes.size() > left) return absl::DataLossError("No space left on device");
        left -= bytes.size();
        return absl::OkStatus();
      },
      options, kAbout, {}, run.engine());
  for (int step = 1; step <= 10'000; ++step) run.Step(&recorder);
  recorder.OnEnd();
  EXPECT_FALSE(recorder.status().ok());
  EXPECT_EQ(warnings.size(), 1u);
}

TEST(Recorder, AllocatesNothingInAStep) {
  Disk disk;
  FakeRun run;
  Recorder recorder(disk.sink(), {}, kAbout, {}, run.engine());
  disk.Stop();
  // The writer allocates; so it must stand still while steps are counted.
  while (!disk.waiting()) {
    run.Step(&recorder);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  run.needle().has_target = true;
  run.frame().frame.zones.resize(2);
  run.frame().frame.contact_forces.resize(3);
  const long before = test::allocations;
  for (int step = 1; step <= 1000; ++step) run.Step(&recorder);
  EXPECT_EQ(test::allocations, before);
  disk.Go();
  recorder.OnEnd();
}

}  // namespace
}  // namespace adhesim
