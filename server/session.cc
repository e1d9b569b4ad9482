#include "server/session.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/errors.h"

namespace adhesim {
namespace {

constexpr int kStepPriority = 60;
constexpr int kObserverPriority = 40;
constexpr int kObserverWaitMs = 50;
constexpr int kPausedWaitMs = 100;
constexpr std::int64_t kHeartbeatNs = 250'000'000;
// Steps that may be made up for; beyond them time is given up.
constexpr std::int64_t kCatchUpSteps = 3;

SessionFrame FirstFrame(const Engine& engine, v1::SessionState state) {
  SessionFrame first = MakeSessionFrame(engine);
  first.state = state;
  first.published_ns = MonotonicNs();
  return first;
}

v1::SessionState StartState(const Session::Options& options) {
  return options.paused ? v1::SESSION_STATE_PAUSED : v1::SESSION_STATE_RUNNING;
}

}  // namespace

SessionFrame MakeSessionFrame(const Engine& engine) {
  SessionFrame frame;
  frame.frame = engine.MakeFrame();
  frame.newest_pose.resize(engine.model().tools.size());
  frame.target_jumps.resize(engine.model().tools.size());
  frame.fidelity = FidelityOf(engine);
  return frame;
}

SessionFidelity FidelityOf(const Engine& engine) {
  const std::span<const FidelityRung> rungs = engine.rungs();
  SessionFidelity fidelity;
  fidelity.possible = !rungs.empty();
  fidelity.rungs = std::min(engine.fidelity(), Governor::kMaxRungs);
  std::copy_n(rungs.begin(), fidelity.rungs, fidelity.lowered.begin());
  return fidelity;
}

Session::Session(std::unique_ptr<Engine> engine, const Options& options, SessionObserver* observer)
    : options_(options),
      engine_(std::move(engine)),
      period_ns_(std::llround(engine_->model().dt_s * 1e9)),
      observer_(observer),
      state_(StartState(options)),
      governor_(
          {step_budget_s(), engine_->model().dt_s, static_cast<int>(engine_->rungs().size())}),
      inputs_(engine_->model().tools.size()),
      frames_([this] { return FirstFrame(*engine_, state_); }),
      snapshot_{state_, 0, 0.0, {}, ""},
      paused_when_done_(options.paused) {
  totals_.newest_pose.resize(inputs_.size());
  totals_.target_jumps.resize(inputs_.size());
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    watches_.emplace_back(engine_->model().dt_s);
    poses_.push_back(std::make_unique<NewestWins<OperatorPose>>());
  }
  step_thread_ = std::thread([this] { StepLoop(); });
  try {
    observer_thread_ = std::thread([this] { ObserveLoop(); });
  } catch (...) {  // the system has no thread left: the destructor will not run
    stop_.store(true);
    command_waker_.Wake();
    step_thread_.join();
    throw;
  }
}

Session::~Session() { Stop(Error(Reason::kSessionDeleted, "the session was deleted")); }

Session::Snapshot Session::snapshot() const {
  const std::lock_guard lock(mutex_);
  return snapshot_;
}

absl::Status Session::Submit(CommandKind kind, std::uint32_t steps, CommandDone done) {
  const std::lock_guard lock(mutex_);
  if (stopped_) return Error(Reason::kSessionDeleted, "the session was deleted");
  if (snapshot_.state == v1::SESSION_STATE_FROZEN && kind != CommandKind::kReset) {
    return Error(
        Reason::kSessionFrozen,
        absl::StrCat("the session is frozen: ", snapshot_.frozen_because, "; reset or delete it"));
  }
  if (kind == CommandKind::kStep) {
    if (steps < 1 || steps > kMaxStepsAtOnce) {
      const std::string what =
          absl::StrCat("steps is ", steps, ", permitted are 1 to ", kMaxStepsAtOnce);
      return Error(Reason::kArgumentInvalid, what, {{"steps", what}});
    }
    if (!paused_when_done_) {
      return Error(Reason::kSessionNotPaused, "steps can be taken in a paused session only");
    }
  }
  if (!commands_.Push({kind, steps})) {
    return Error(Reason::kTooManyRequests, "64 commands are waiting for this session already");
  }
  if (kind == CommandKind::kPause) paused_when_done_ = true;
  if (kind == CommandKind::kResume) paused_when_done_ = false;
  pending_.push_back({++commands_submitted_, std::move(done)});
  command_waker_.Wake();
  return absl::OkStatus();
}

bool Session::PostPose(int tool, const OperatorPose& pose) {
  NewestWins<OperatorPose>& mailbox = *poses_[tool];
  mailbox.back() = pose;
  return mailbox.Publish();
}

void Session::Stop(const absl::Status& why) {
  {
    const std::lock_guard lock(mutex_);
    if (stopped_) return;
    stopped_ = true;
    why_ = why;
  }
  stop_.store(true);
  command_waker_.Wake();
  step_thread_.join();
  if (options_.step_observer) options_.step_observer->OnEnd();
  observer_stop_.store(true);
  observer_waker_.Wake();
  observer_thread_.join();
}

// ---------------------------------------------------------------- the stepping thread

void Session::StepLoop() {
  if (options_.realtime) realtime_class_.store(BecomeRealtime(kStepPriority));
  std::int64_t release_ns = MonotonicNs();
  while (!stop_.load(std::memory_order_relaxed)) {
    RunCommands();
    if (!stepping()) {
      command_waker_.Wait(kPausedWaitMs);
      release_ns = MonotonicNs();
      continue;
    }
    StepOnce(false);
    release_ns = NextRelease(release_ns);
    SleepUntil(release_ns);
  }
}

// When the next step starts, given when this one did; books lateness.
std::int64_t Session::NextRelease(std::int64_t release_ns) {
  const std::int64_t now_ns = MonotonicNs();
  std::int64_t next_ns = release_ns + period_ns_;
  const std::int64_t late_ns = now_ns - next_ns;
  if (late_ns > 0) ++timing_.deadline_misses;
  if (late_ns > kCatchUpSteps * period_ns_) {
    // To a start in the future: an overloaded session sleeps now and then, so that others run too.
    const std::int64_t skipped = late_ns / period_ns_ + 1;
    timing_.skipped_steps += skipped;
    next_ns += skipped * period_ns_;
  }
  timing_.lag_s = timing_.skipped_steps * engine_->model().dt_s +
                  (now_ns > next_ns ? (now_ns - next_ns) * 1e-9 : 0.0);
  return next_ns;
}

void Session::RunCommands() {
  Command command;
  while (!stop_.load(std::memory_order_relaxed) && commands_.Pop(&command)) {
    switch (command.kind) {
      case CommandKind::kPause:
        if (stepping()) SetState(v1::SESSION_STATE_PAUSED);
        break;
      case CommandKind::kResume:
        if (state_ == v1::SESSION_STATE_PAUSED) SetState(v1::SESSION_STATE_RUNNING);
        break;
      case CommandKind::kStep:
        if (!RunSteps(command.steps)) return;  // answered with why the session ends
        break;
      case CommandKind::kReset:
        Reset();
        break;
    }
    ++commands_done_;
    SessionFrame& slot = frames_.back();
    slot = frames_.published();
    Publish();
  }
}

// As fast as they can be computed, so without the right to keep others waiting. False when the
// session was stopped before the last of them.
bool Session::RunSteps(std::uint32_t steps) {
  if (options_.realtime) BecomePlain();
  bool stopped = false;
  for (std::uint32_t i = 0; i < steps && state_ != v1::SESSION_STATE_FROZEN && !stopped; ++i) {
    stopped = stop_.load(std::memory_order_relaxed);
    if (!stopped) StepOnce(true);
  }
  if (options_.realtime) BecomeRealtime(kStepPriority);
  return !stopped;
}

void Session::TakePoses() {
  for (std::size_t i = 0; i < watches_.size(); ++i) {
    const Pose* pose = nullptr;
    if (poses_[i]->Update()) {
      totals_.newest_pose[i] = poses_[i]->front();
      pose = &totals_.newest_pose[i].pose;
    }
    inputs_[i] = watches_[i].Next(pose);
  }
}

void Session::StepOnce(bool hurried) {
  const std::int64_t start_ns = MonotonicNs();
  TakePoses();
  // What has no deadline has all the time that full fidelity takes.
  const bool governed = !hurried || options_.step_cost;
  engine_->SetFidelity(governed ? governor_.rung() : 0);
  const StepReport report = engine_->Step(inputs_);
  if (engine_->frozen()) {
    Freeze(report);
    TellStep(hurried);
    return;
  }
  SessionFrame& slot = frames_.back();
  engine_->WriteFrame(&slot.frame);
  for (std::size_t i = 0; i < watches_.size(); ++i) {
    std::uint32_t& flags = slot.frame.tools[i].flags;
    if (watches_[i].operator_lost()) flags |= kToolOperatorLost;
    if (inputs_[i].retracted) flags |= kToolRetracted;
    if (flags & kToolTargetJumped) ++totals_.target_jumps[i];
  }
  totals_.captures += report.captures;
  totals_.releases += report.releases;
  totals_.report_bits |= report.bits;
  timing_.step_duration_s = (MonotonicNs() - start_ns) * 1e-9;
  timing_.lowered_rungs = engine_->fidelity();
  Publish();
  TellStep(hurried);
  if (governed) Govern(start_ns);
}

// Everything that the step took, its record included.
void Session::Govern(std::int64_t start_ns) {
  const double took_s = (MonotonicNs() - start_ns) * 1e-9;
  governor_.Observe(options_.step_cost ? options_.step_cost(took_s) : took_s);
}

// After the frame is out, so that nobody waits for the observer.
void Session::TellStep(bool hurried) {
  if (!options_.step_observer) return;
  options_.step_observer->OnStep(*engine_, inputs_, frames_.published(), hurried);
}

void Session::SetState(v1::SessionState state) {
  state_ = state;
  if (options_.step_observer) options_.step_observer->OnState(state);
}

// Nothing of the frozen state is published: the last good frame stays, and says that the session is
// frozen.
void Session::Freeze(const StepReport& report) {
  state_before_freeze_ = state_;
  state_ = v1::SESSION_STATE_FROZEN;
  totals_.report_bits |= report.bits | kStepNonFinite;
  SessionFrame& slot = frames_.back();
  slot = frames_.published();
  slot.frozen_because = engine_->FrozenBecause();  // allocates: nothing is in a hurry any more
  Publish();
}

void Session::Reset() {
  engine_->Reset();
  governor_.Reset();
  engine_->SetFidelity(0);
  if (state_ == v1::SESSION_STATE_FROZEN) state_ = state_before_freeze_;
  for (std::size_t i = 0; i < watches_.size(); ++i) {
    // A pose that has come in is from before the reset.
    poses_[i]->Update();
    watches_[i].Reset();
    totals_.newest_pose[i] = OperatorPose{};
    totals_.target_jumps[i] = 0;
  }
  totals_.captures = totals_.releases = 0;
  totals_.report_bits = 0;
  timing_ = SessionTiming{};
  engine_->WriteFrame(&frames_.back().frame);
  Publish();
  if (options_.step_observer) options_.step_observer->OnReset(frames_.published());
}

// Hands over frames_.back(), whose `frame` is written.
void Session::Publish() {
  SessionFrame& slot = frames_.back();
  slot.newest_pose = totals_.newest_pose;
  slot.target_jumps = totals_.target_jumps;
  slot.captures = totals_.captures;
  slot.releases = totals_.releases;
  slot.report_bits = totals_.report_bits;
  slot.state = state_;
  if (state_ != v1::SESSION_STATE_FROZEN) slot.frozen_because.clear();
  slot.timing = timing_;
  slot.fidelity = FidelityOf(*engine_);
  slot.fidelity.changes = governor_.changes();
  slot.fidelity.budget_s = governor_.budget_s();
  slot.commands_done = commands_done_;
  slot.published_ns = MonotonicNs();
  frames_.Publish();
  observer_waker_.Wake();
}

// ---------------------------------------------------------------- the observer thread

void Session::ObserveLoop() {
  if (options_.realtime) BecomeRealtime(kObserverPriority);
  Observe(true);
  std::int64_t next_heartbeat_ns = MonotonicNs();
  while (!observer_stop_.load()) {
    observer_waker_.Wait(kObserverWaitMs);
    Observe(frames_.Update());
    const std::int64_t now_ns = MonotonicNs();
    if (now_ns < next_heartbeat_ns) continue;
    observer_->OnHeartbeat(frames_.front());
    next_heartbeat_ns = now_ns + kHeartbeatNs;
  }
  absl::Status why;
  std::uint64_t submitted;
  {
    const std::lock_guard lock(mutex_);
    why = why_;
    submitted = commands_submitted_;
  }
  FinishCommands(submitted, why);
  observer_->OnEnd(why);
}

void Session::Observe(bool fresh) {
  const SessionFrame& frame = frames_.front();
  if (fresh) {
    const std::lock_guard lock(mutex_);
    snapshot_ = {frame.state, frame.frame.step, frame.frame.time_s, frame.timing,
                 frame.frozen_because};
  }
  observer_->OnFrame(frame, fresh);
  if (fresh) FinishCommands(frame.commands_done, absl::OkStatus());
}

void Session::FinishCommands(std::uint64_t up_to, const absl::Status& status) {
  while (true) {
    CommandDone done;
    {
      const std::lock_guard lock(mutex_);
      if (pending_.empty() || pending_.front().number > up_to) return;
      done = std::move(pending_.front().done);
      pending_.pop_front();
    }
    done(status);
  }
}

}  // namespace adhesim
