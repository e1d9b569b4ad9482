#include "core/study/accuracy_advice.h"

#include <algorithm>
#include <tuple>

namespace adhesim {
namespace {

// Rates are ratios of powers of two of the scene's; round-off must not lose one.
constexpr double kSameRate = 1 - 1e-9;

double Over(double error, double tolerance) {
  if (error == 0) return 0;
  return tolerance > 0 ? error / tolerance : 1e300;
}

}  // namespace

double OverTolerance(const AdviceCandidate& candidate, const AdviceLimits& limits) {
  if (limits.by_observables) return Over(candidate.share, limits.tolerance_share);
  const double position = Over(candidate.error_m, limits.tolerance_m);
  if (!candidate.force_n) return position;
  return std::max(position, Over(*candidate.force_n, limits.tolerance_n));
}

bool KeepsRate(const AdviceCandidate& candidate, const AdviceLimits& limits) {
  return candidate.rate_hz >= kSameRate * limits.rate_hz &&
         candidate.step_share <= limits.step_share;
}

Advice Advise(std::span<const AdviceCandidate> candidates, const AdviceLimits& limits) {
  Advice advice;
  const auto over = [&](int i) { return OverTolerance(candidates[i], limits); };
  for (int i = 0; i < static_cast<int>(candidates.size()); ++i) {
    const AdviceCandidate& one = candidates[i];
    if (!one.usable) continue;
    if (over(i) <= 1) {
      const int best = advice.cheapest;
      if (best < 0 ||
          std::tuple(one.cost, over(i)) < std::tuple(candidates[best].cost, over(best))) {
        advice.cheapest = i;
      }
    }
    if (KeepsRate(one, limits)) {
      const int best = advice.most_accurate;
      if (best < 0 ||
          std::tuple(over(i), one.cost) < std::tuple(over(best), candidates[best].cost)) {
        advice.most_accurate = i;
      }
    }
  }
  return advice;
}

}  // namespace adhesim
