#include "clients/cli/headless_run.h"

#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cmath>

#include "server/governor.h"
#include "server/session.h"

namespace adhesim {
namespace {

// Figures that look at the whole state are taken so often, and at the end.
constexpr std::uint64_t kSampleEvery = 100;

double Now(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void SleepUntil(double time_s) {
  const double whole = std::floor(time_s);
  const timespec t{static_cast<time_t>(whole), static_cast<long>((time_s - whole) * 1e9)};
  // A signal ends the wait early; the caller looks at its flag before the next step.
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

// Only closed bodies can have something of another body inside.
bool MayOverlap(const Model& model) {
  const auto closed = [](const Body& body) { return body.closed; };
  return model.bodies.size() > 1 && std::any_of(model.bodies.begin(), model.bodies.end(), closed);
}

// Sums of wall and processor time, ms.
class Stopwatch {
 public:
  explicit Stopwatch(clockid_t cpu_clock) : cpu_clock_(cpu_clock) {}

  template <typename Work>
  void Time(const Work& work) {
    const double cpu_before_s = Now(cpu_clock_);
    const double wall_before_s = Now(CLOCK_MONOTONIC);
    work();
    wall_ms += 1e3 * (Now(CLOCK_MONOTONIC) - wall_before_s);
    cpu_ms += 1e3 * (Now(cpu_clock_) - cpu_before_s);
  }
  double wall_ms = 0, cpu_ms = 0;

 private:
  clockid_t cpu_clock_;
};

void CountStep(const StepReport& report, SessionFrame* frame) {
  frame->captures += report.captures;
  frame->releases += report.releases;
  frame->report_bits |= report.bits;
  for (std::size_t i = 0; i < frame->frame.tools.size(); ++i) {
    if (frame->frame.tools[i].flags & kToolTargetJumped) ++frame->target_jumps[i];
  }
}

void Observe(const Engine& engine, const Frame& frame, bool sample, RunStatistics* statistics) {
  statistics->colliding_particles.Add(frame.colliding_particles);
  statistics->zones.Add(static_cast<int>(frame.zones.size()));
  for (std::size_t i = 0; i < frame.tools.size(); ++i) {
    statistics->peak_force_n[i] =
        std::max(statistics->peak_force_n[i], frame.tools[i].tissue.force_n.norm());
    statistics->force_error_n[i] =
        std::max(statistics->force_error_n[i], frame.tools[i].force_error_n);
  }
  if (const std::optional<double> error = VolumeError(engine.model(), engine.state())) {
    statistics->volume_error_max = std::max(statistics->volume_error_max.value_or(0), *error);
  }
  if (!sample) return;
  const MomentumError error = MomentumBalance(engine.model(), engine.state());
  if (MayOverlap(engine.model())) {
    const Penetration now = MeasurePenetration(engine.model(), engine.state().position_m);
    Penetration& worst =
        statistics->penetration ? *statistics->penetration : statistics->penetration.emplace();
    worst.max_depth_m = std::max(worst.max_depth_m, now.max_depth_m);
    worst.vertices_inside = std::max(worst.vertices_inside, now.vertices_inside);
  }
  const MomentumLedger& scale = engine.state().momentum;
  MomentumError& worst = statistics->momentum_imbalance;
  worst.linear = std::max(worst.linear, error.linear * scale.scale_linear);
  worst.angular = std::max(worst.angular, error.angular * scale.scale_angular);
}

}  // namespace

void CountStatistics::Add(int count) {
  sum += count;
  ++samples;
  max = std::max(max, count);
  final = count;
}

RunStatistics RunHeadless(Engine* engine, const RunOptions& options,
                          const std::atomic<bool>& stop) {
  RunStatistics statistics;
  statistics.peak_force_n.assign(engine->model().tools.size(), 0);
  statistics.force_error_n.assign(engine->model().tools.size(), -1);
  SessionFrame seen = MakeSessionFrame(*engine);
  const int rungs = static_cast<int>(engine->rungs().size());
  statistics.steps_without.assign(rungs + 1, 0);
  Governor governor({options.step_budget_s, engine->model().dt_s, rungs});
  const clockid_t cpu_clock =
      options.one_thread ? CLOCK_THREAD_CPUTIME_ID : CLOCK_PROCESS_CPUTIME_ID;
  const double dt_s = engine->model().dt_s;
  double due_s = Now(CLOCK_MONOTONIC);  // when the next step begins

  for (std::uint64_t step = 0; step < options.steps; ++step) {
    if (options.realtime) SleepUntil(due_s);
    statistics.interrupted = stop.load();
    if (statistics.interrupted) break;

    if (governor.budget_s() > 0 && engine->fidelity() != governor.rung()) {
      engine->SetFidelity(governor.rung());
      seen.fidelity = FidelityOf(*engine);
      seen.fidelity.changes = governor.changes();
      seen.fidelity.budget_s = governor.budget_s();
    }
    Stopwatch clock(cpu_clock);
    StepReport report;
    clock.Time([&] { report = engine->Step({}); });
    statistics.report_bits |= report.bits;
    if (report.bits & kStepNotConverged) ++statistics.unconverged_steps;
    ++statistics.steps;
    if (options.observer != nullptr) {
      if (!engine->frozen()) engine->WriteFrame(&seen.frame);
      CountStep(report, &seen);
      seen.timing.step_duration_s = 1e-3 * clock.wall_ms;
      clock.Time([&] { options.observer->OnStep(*engine, {}, seen, !options.realtime); });
    }
    const double wall_after_s = Now(CLOCK_MONOTONIC);
    governor.Observe(1e-3 * clock.wall_ms);

    // A missed deadline is counted once: the schedule goes on from there, without a debt.
    due_s += dt_s;
    const bool missed = options.realtime && wall_after_s > due_s;
    if (missed) due_s = wall_after_s;
    if (step < options.measure_from) continue;
    if (missed) ++statistics.deadline_misses;
    ++statistics.steps_without[engine->fidelity()];
    statistics.fidelity_changes = governor.changes();
    statistics.wall_ms.push_back(static_cast<float>(clock.wall_ms));
    statistics.cpu_ms.push_back(static_cast<float>(clock.cpu_ms));
    engine->WriteFrame(&seen.frame);
    const bool last = step + 1 == options.steps || engine->frozen();
    Observe(*engine, seen.frame, last || (step + 1) % kSampleEvery == 0, &statistics);
    if (engine->frozen()) break;
  }
  return statistics;
}

}  // namespace adhesim
