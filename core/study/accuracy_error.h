#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/study/accuracy_trace.h"

namespace adhesim {

// A difference of two runs over their common instants.
struct ErrorNorms {
  double final = 0;  // at the last instant: root mean square over probes (or tools)
  double l2 = 0;     // root mean square over instants of the same
  double linf = 0;   // the largest at any instant of any probe (or tool)
};

// The later or earlier time of an event in one of two runs; absent where only one run has it.
struct EventError {
  std::string what;
  std::optional<double> reference_s, error_s;
};

// One number that a whole run is judged by where its positions cannot be foreseen.
struct Observable {
  std::string name, unit;
  double value = 0, reference = 0;
  double share = 0;  // |value - reference| over the observable's scale
};

// What a run differs by from another that is taken as true.
struct AccuracyError {
  ErrorNorms position_m;
  std::optional<ErrorNorms> force_n;  // of scenes with tools
  std::vector<EventError> events;
  double worst_event_s = 0;  // of those that both runs have
  int lost_events = 0;       // that only one of them has
  std::vector<Observable> observables;
  double worst_share = 0;  // of the observables
};

// Both came to their end and have the same instants and probes.
AccuracyError Compare(const AccuracyTrace& trace, const AccuracyTrace& truth);

// Root mean square over instants and probes of the way from the first instant to each, m: what
// errors of position are relative to. `rest_m` is where the probes started.
double MotionOf(const AccuracyTrace& trace, std::span<const Vec3> rest_m);

// Largest force on any tool at any instant, N; 0 without tools.
double PeakForce(const AccuracyTrace& trace);

// Two runs of the same problem part by more than this share of the motion: positions cannot be
// foreseen, and observables are judged instead.
inline constexpr double kChaoticShare = 0.1;

// The power of dt by which errors fall: least squares of log error over log dt. Nothing of fewer
// than three points, or of errors that are not above 0.
struct FittedOrder {
  double order = 0, factor = 0;  // error = factor * dt^order
};
std::optional<FittedOrder> FitOrder(std::span<const double> dt_s, std::span<const double> error);

}  // namespace adhesim
