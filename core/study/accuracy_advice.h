#pragma once

#include <optional>
#include <span>
#include <string>

namespace adhesim {

// A setting that was measured, as far as advice needs it.
struct AdviceCandidate {
  bool usable = false;  // it ran to its end, and solves the scene's own equations and mesh
  double rate_hz = 0;   // steps per simulated second
  double error_m = 0;   // of positions
  std::optional<double> force_n;  // error of tools' forces
  double share = 0;               // worst of the observables
  double cost = 0;                // wall time per simulated time; below 1: faster than real time
  double step_share = 0;          // 99th percentile of a step's wall time over its dt
};

// What is demanded.
struct AdviceLimits {
  bool by_observables = false;  // positions and forces cannot be foreseen: the observables' share
  double tolerance_m = 0;
  double tolerance_n = 0;
  double tolerance_share = 0;
  double rate_hz = 0;     // a session steps at least so often
  double step_share = 1;  // of a step's time that stepping may take
};

// Indices of candidates; -1: none does.
struct Advice {
  int cheapest = -1;       // within the tolerances
  int most_accurate = -1;  // that keeps the rate
};

// Where two are equally cheap (accurate), the more accurate (cheaper) one. The most accurate is
// that of the least error over its tolerance, the larger of position's and force's.
Advice Advise(std::span<const AdviceCandidate> candidates, const AdviceLimits& limits);

// Error over tolerance: the larger of position's and force's, or the observables'. At most 1: it is
// within.
double OverTolerance(const AdviceCandidate& candidate, const AdviceLimits& limits);

// Whether it steps at least as often as demanded, and in time.
bool KeepsRate(const AdviceCandidate& candidate, const AdviceLimits& limits);

}  // namespace adhesim
