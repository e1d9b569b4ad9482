#pragma once

#include <absl/status/status.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "adhesim/v1/status.pb.h"
#include "core/engine/engine.h"
#include "core/model/frame.h"
#include "server/governor.h"
#include "server/mailbox.h"
#include "server/operator_watch.h"
#include "server/realtime.h"
#include "server/step_observer.h"

namespace adhesim {

// A pose as its operator sent it; checked (finite, unit quaternion).
struct OperatorPose {
  Pose pose;
  std::uint64_t operator_id = 0;    // whose
  std::uint64_t sequence = 0;       // the operator's own count
  std::int64_t client_time_ns = 0;  // the operator's own clock
  std::int64_t received_ns = 0;     // MonotonicNs()
};

// How well a session keeps real time; counted since the start or the last reset.
struct SessionTiming {
  std::uint64_t deadline_misses = 0;  // steps that ended after the next one's start
  std::uint64_t skipped_steps = 0;    // left out: more than three steps late
  double lag_s = 0;                   // how far simulated time is behind the clock
  double step_duration_s = 0;         // of the last step
  std::uint32_t lowered_rungs = 0;    // of fidelity, in the last step
};

// What the last step did without.
struct SessionFidelity {
  int rungs = 0;
  std::array<FidelityRung, Governor::kMaxRungs> lowered{};  // the first `rungs` of them
  bool possible = false;                                    // the engine has rungs
  std::uint64_t changes = 0;
  double budget_s = 0;  // 0: nobody governs
};
// As the engine is set; without what its governor knows.
SessionFidelity FidelityOf(const Engine& engine);

// What leaves a session after a step.
struct SessionFrame {
  Frame frame;
  std::vector<OperatorPose> newest_pose;    // [#tools] the newest that a step used
  std::vector<std::uint64_t> target_jumps;  // [#tools] counts, so that a slow reader misses none
  std::uint64_t captures = 0;               // likewise
  std::uint64_t releases = 0;
  std::uint32_t report_bits = 0;
  v1::SessionState state = v1::SESSION_STATE_RUNNING;
  std::string frozen_because;  // Engine::FrozenBecause(): what, where and when
  SessionTiming timing;
  SessionFidelity fidelity;
  std::int64_t published_ns = 0;
  std::uint64_t commands_done = 0;  // of those submitted
};

// A frame with every array at its final size, showing the engine's state now.
SessionFrame MakeSessionFrame(const Engine& engine);

// Who a session tells what happens; called on the session's observer thread only.
class SessionObserver {
 public:
  virtual ~SessionObserver() = default;
  // At least 20 times a second, and soon after every step; `fresh`: newer than at the last call.
  // Frames that the observer was too slow for are never seen.
  virtual void OnFrame(const SessionFrame& frame, bool fresh) = 0;
  // Four times a second.
  virtual void OnHeartbeat(const SessionFrame& frame) = 0;
  // Last call.
  virtual void OnEnd(const absl::Status& why) = 0;
};

// One engine on a thread of its own, at a fixed rate on absolute deadlines.
//
// That thread takes poses from mailboxes and commands from a bounded queue, and leaves frames in a
// mailbox: it never waits for anyone, and allocates, logs and sends nothing. A second thread, the
// observer, carries the frames to everyone else. A step that ends late is a deadline miss; more
// than three steps late, steps are left out (simulated time falls behind the clock), since catching
// up without limit would pile up seconds of debt.
class Session {
 public:
  struct Options {
    bool realtime = true;                         // false: both threads stay in the plain class
    bool paused = false;                          // before the first step
    std::shared_ptr<StepObserver> step_observer;  // or null
    // What a step may take before fidelity is lowered; 0: it never is. Absent: kBudgetShare of dt.
    std::optional<double> step_budget_s;
    // What the governor is told that a step took, given what it did, s; null: just that. Called on
    // the stepping thread, also in steps that have no deadline, which are not governed without it.
    std::function<double(double)> step_cost;
  };
  enum class CommandKind { kPause, kResume, kStep, kReset };
  // Called on the observer thread when the command has been carried out, or never will be.
  using CommandDone = std::function<void(const absl::Status&)>;

  static constexpr std::uint32_t kMaxStepsAtOnce = 100'000;
  static constexpr double kBudgetShare = 0.8;  // the rest is for waking and for the frame

  // What GetSession shows.
  struct Snapshot {
    v1::SessionState state;
    std::uint64_t step;
    double time_s;
    SessionTiming timing;
    std::string frozen_because;
  };

  // `observer` outlives the session.
  Session(std::unique_ptr<Engine> engine, const Options& options, SessionObserver* observer);
  ~Session();

  const Model& model() const { return engine_->model(); }
  RealtimeClass realtime_class() const { return realtime_class_.load(); }
  double step_budget_s() const {
    return options_.step_budget_s.value_or(kBudgetShare * model().dt_s);
  }
  Snapshot snapshot() const;

  // Any thread. FailedPrecondition when the session is not in a state for it; then `done` is not
  // called.
  absl::Status Submit(CommandKind kind, std::uint32_t steps, CommandDone done);

  // Where a tool shall go. Any thread, but one at a time for each tool. True: an earlier pose was
  // overtaken unused.
  bool PostPose(int tool, const OperatorPose& pose);

  // Any thread: has OnFrame() called soon.
  void WakeObserver() { observer_waker_.Wake(); }

  // Ends both threads; commands still waiting fail with `why`. Not from the observer thread.
  void Stop(const absl::Status& why);

 private:
  struct Command {
    CommandKind kind = CommandKind::kPause;
    std::uint32_t steps = 0;
  };
  struct PendingCommand {
    std::uint64_t number;
    CommandDone done;
  };

  // The stepping thread.
  void StepLoop();
  void RunCommands();
  bool RunSteps(std::uint32_t steps);
  void SetState(v1::SessionState state);
  // `hurried`: as part of RunSteps().
  void StepOnce(bool hurried);
  void TellStep(bool hurried);
  void Govern(std::int64_t start_ns);
  void TakePoses();
  void Reset();
  void Freeze(const StepReport& report);
  void Publish();
  std::int64_t NextRelease(std::int64_t release_ns);
  bool stepping() const { return state_ == v1::SESSION_STATE_RUNNING; }

  // The observer thread.
  void ObserveLoop();
  void Observe(bool fresh);
  void FinishCommands(std::uint64_t up_to, const absl::Status& status);

  const Options options_;
  const std::unique_ptr<Engine> engine_;
  const std::int64_t period_ns_;
  SessionObserver* const observer_;
  std::atomic<RealtimeClass> realtime_class_{RealtimeClass::kPlain};

  // Owned by the stepping thread.
  v1::SessionState state_;
  v1::SessionState state_before_freeze_ = v1::SESSION_STATE_RUNNING;
  SessionTiming timing_;
  std::uint64_t commands_done_ = 0;
  Governor governor_;
  std::vector<OperatorWatch> watches_;  // [#tools]
  std::vector<ToolInput> inputs_;       // [#tools]
  SessionFrame totals_;                 // counts and newest poses; its `frame` is unused

  // Between the threads.
  std::vector<std::unique_ptr<NewestWins<OperatorPose>>> poses_;  // [#tools]
  NewestWins<SessionFrame> frames_;
  BoundedQueue<Command, 64> commands_;
  Waker command_waker_;
  Waker observer_waker_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> observer_stop_{false};

  // Guards the rest (but the threads). A standard mutex: thread sanitizers cannot see into the
  // packaged Abseil's.
  mutable std::mutex mutex_;
  Snapshot snapshot_;
  std::uint64_t commands_submitted_ = 0;
  bool paused_when_done_;  // once every submitted command is carried out
  bool stopped_ = false;
  std::deque<PendingCommand> pending_;
  absl::Status why_;

  std::thread step_thread_;
  std::thread observer_thread_;
};

}  // namespace adhesim
