#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/contact/penetration.h"
#include "core/engine/engine.h"
#include "core/model/diagnostics.h"
#include "server/step_observer.h"

namespace adhesim {

// Mean, maximum and last of a count.
struct CountStatistics {
  double sum = 0;
  std::int64_t samples = 0;
  int max = 0;
  int final = 0;

  void Add(int count);
  double mean() const { return samples == 0 ? 0 : sum / static_cast<double>(samples); }
};

// What a run measured, from the step `measure_from` on.
struct RunStatistics {
  std::uint64_t steps = 0;             // made in all
  std::vector<float> wall_ms, cpu_ms;  // of each step measured
  std::int64_t deadline_misses = 0;    // with real time only
  std::uint64_t fidelity_changes = 0;
  std::vector<std::uint64_t> steps_without;  // [#rungs + 1] measured with so many given up
  bool interrupted = false;
  std::uint32_t report_bits = 0;       // StepBit of any step
  std::int64_t unconverged_steps = 0;  // in which the implicit solver stopped at max_iterations
  CountStatistics colliding_particles, zones;
  std::optional<double> volume_error_max;
  std::optional<Penetration> penetration;  // largest at the sampled instants
  // Largest at the sampled instants, times the scale then: kg m/s and kg m^2/s. At rest both are
  // round-off.
  MomentumError momentum_imbalance;
  std::vector<double> peak_force_n;   // [#tools]
  std::vector<double> force_error_n;  // [#tools] largest error bar; < 0: it never had one
};

struct RunOptions {
  std::uint64_t steps = 0;
  std::uint64_t measure_from = 0;    // < steps
  bool realtime = false;             // each step begins no earlier than its time
  double step_budget_s = 0;          // fidelity is given up when steps take longer; 0: never
  bool one_thread = true;            // the engine works on the calling thread only
  StepObserver* observer = nullptr;  // records; its time counts as the step's
};

// Steps the engine until the end, a non-finite state, or `stop`.
RunStatistics RunHeadless(Engine* engine, const RunOptions& options, const std::atomic<bool>& stop);

}  // namespace adhesim
