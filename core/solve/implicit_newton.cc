// The part of the implicit solver that is about Newton's method.

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/solve/implicit_solver.h"

namespace adhesim {
namespace {

constexpr double kNewtonForcing = 1e-3;  // what a linear solve leaves of Newton's residual
constexpr double kSlopeLeft = 0.2;       // of the slope at the start, where a line search ends
constexpr int kSearchAttempts = 8;
constexpr double kNearlyMet = 1e-9;  // of a row, relative
constexpr int kBalances = 3;         // each leaves some hundredths of what momentum lacks

}  // namespace

// r = dt f(x_n + dt v, v) - M (v - v_n) of the velocities tried, and its norm. Damping is that of
// the tangents at the end: on chords a body that just turns would be taken to grow, and be pressed
// together.
double ImplicitSolver::NewtonResidual(double dt_s, const State& state, Parallel* parallel) {
  for (std::size_t p = 0; p < velocity_m_s_.size(); ++p) {
    velocity_m_s_[p] = prescribed_m_s_[p].vec() + change_m_s_[p].vec();
    position_m_[p] = state.position_m[p] + dt_s * velocity_m_s_[p];
    if (!damped_m_s_.empty()) {
      damped_m_s_[p] = velocity_m_s_[p] + arcs_.AtEnd(model_.body_of[p], position_m_[p]);
    }
  }
  const std::span<const Vec3> damped = damped_m_s_.empty() ? velocity_m_s_ : damped_m_s_;
  EvaluateStiff({position_m_, damped, state.time_s, effect_state_, parallel, near_, true});
  for (std::size_t p = 0; p < velocity_m_s_.size(); ++p) {
    residual_ns_[p] = Padded{};
    if (!system_.active(static_cast<int>(p))) continue;
    residual_ns_[p].Set(dt_s * (explicit_n_[p] + elastic_n_[p] + damping_n_[p]) +
                        InnerImpulse(static_cast<int>(p)) -
                        model_.mass_kg[p] * (velocity_m_s_[p] - state.velocity_m_s[p]));
  }
  return system_.Precondition(residual_ns_, product_, parallel);
}

double ImplicitSolver::Slope(std::span<const Padded> direction) const {
  double sum = 0;
  for (std::size_t p = 0; p < direction.size(); ++p) {
    sum -= direction[p].vec().dot(residual_ns_[p].vec());
  }
  return sum;
}

// Looks for the end of descent along a direction by its slope: energies would lose their digits
// near the solution, and damping has none. Secants, kept within what is known to lie too near and
// too far.
void ImplicitSolver::SearchAlong(std::span<const Padded> direction, double dt_s, const State& state,
                                 Parallel* parallel) {
  const double start = Slope(direction);
  double near = 0, near_slope = start, far = 0, far_slope = 0, taken = 0, step = 1;
  for (int attempt = 0;; ++attempt) {
    for (std::size_t p = 0; p < direction.size(); ++p) {
      for (int k = 0; k < 3; ++k) change_m_s_[p].v[k] += (step - taken) * direction[p].v[k];
    }
    taken = step;
    residual_sq_ = NewtonResidual(dt_s, state, parallel);
    const double slope = Slope(direction);
    if (std::abs(slope) <= kSlopeLeft * std::abs(start) || attempt == kSearchAttempts) return;
    if (slope < 0) {
      near = step;
      near_slope = slope;
    } else {
      far = step;
      far_slope = std::isfinite(slope) ? slope : -near_slope;
    }
    if (far > 0) {
      const double part = near_slope / (near_slope - far_slope);
      step = near + std::clamp(part, 0.1, 0.9) * (far - near);
    } else {
      const double secant = start < slope ? start / (start - slope) : 2;
      step *= std::clamp(secant, 1.1, 4.0);
    }
  }
}

// Rows and forces in turns: the multipliers' impulses are constant, so that each turn is a step of
// its own. Where that leads away, rows are left to the rest of the step.
void ImplicitSolver::NewtonWithRows(std::span<const RigidGroup> groups, double dt_s,
                                    const State& state, Parallel* parallel, StepReport* report) {
  IterateNewton(groups, dt_s, state, parallel, report);
  if (!rows_.empty()) without_rows_m_s_ = change_m_s_;
  double last = std::numeric_limits<double>::infinity();
  for (int turn = 0; turn < kRowIterations && !rows_.empty(); ++turn) {
    iterations_ +=
        rows_.Respond(effort_.tolerance, model_.max_iterations, &system_, parallel, report);
    const double worst = MeasureRows(dt_s, state);
    if (worst <= kRowTolerance) break;
    if (!(worst < last)) {
      if (worst < kNearlyMet) break;  // round-off
      rows_.Start();
      change_m_s_ = without_rows_m_s_;
      NewtonResidual(dt_s, state, parallel);
      break;
    }
    last = worst;
    rows_.Advance(change_m_s_, residual_ns_);
    IterateNewton(groups, dt_s, state, parallel, report);
  }
}

// Contacts that slide and forces in turns likewise. In the end what is loose is moved as a whole,
// as in linear steps.
void ImplicitSolver::SolveNewton(std::span<const RigidGroup> groups, double dt_s,
                                 const State& state, Parallel* parallel, StepReport* report) {
  const bool slides = CollectSlides(groups, dt_s, state);
  NewtonWithRows(groups, dt_s, state, parallel, report);
  if (slides) {
    for (int turn = 0; turn < kSlideTurns; ++turn) {
      const double target = std::max(effort_.tolerance * scale_, round_off_);
      MeetSlides(groups, target, state, parallel, report);
      NewtonWithRows(groups, dt_s, state, parallel, report);
    }
  }
  for (int k = 0; k < kBalances; ++k) {
    system_.Balance(change_m_s_, residual_ns_);
    residual_sq_ = NewtonResidual(dt_s, state, parallel);
  }
  if (!std::isfinite(residual_sq_)) {
    for (Padded& change : change_m_s_) change.v[0] = std::numeric_limits<double>::quiet_NaN();
  }
}

// Newton's directions, made conjugate (Polak and Ribiere): the stiffness is that of a convex model,
// and where it is too stiff Newton alone would creep.
void ImplicitSolver::IterateNewton(std::span<const RigidGroup> groups, double dt_s,
                                   const State& state, Parallel* parallel, StepReport* report) {
  residual_sq_ = NewtonResidual(dt_s, state, parallel);
  const double target =
      std::max(effort_.tolerance * std::max(scale_, std::sqrt(residual_sq_)), round_off_);
  double last_descent = 0;
  for (int k = 0; residual_sq_ > target * target && k < effort_.newton_iterations; ++k) {
    Assemble({position_m_, velocity_m_s_, state.time_s, effect_state_, parallel, near_}, dt_s);
    system_.SetZones(state, groups);
    std::fill(newton_.begin(), newton_.end(), Padded{});
    std::copy(residual_ns_.begin(), residual_ns_.end(), product_.begin());
    const double left = std::max(kNewtonForcing * std::sqrt(residual_sq_), 0.1 * target);
    iterations_ +=
        system_.Solve(left, model_.max_iterations, newton_, product_, parallel).iterations;
    double descent = 0, change = 0;
    for (std::size_t p = 0; p < newton_.size(); ++p) {
      const Vec3 step = newton_[p].vec(), residual = residual_ns_[p].vec();
      descent += step.dot(residual);
      change += step.dot(residual - last_residual_ns_[p].vec());
    }
    const double conjugate = k > 0 ? std::max(0.0, change / last_descent) : 0;
    for (std::size_t p = 0; p < newton_.size(); ++p) {
      for (int c = 0; c < 3; ++c) {
        direction_[p].v[c] = newton_[p].v[c] + (k > 0 ? conjugate * direction_[p].v[c] : 0);
      }
    }
    if (!(Slope(direction_) < 0)) std::copy(newton_.begin(), newton_.end(), direction_.begin());
    last_descent = descent;
    std::copy(residual_ns_.begin(), residual_ns_.end(), last_residual_ns_.begin());
    SearchAlong(direction_, dt_s, state, parallel);
    if (!std::isfinite(residual_sq_)) break;
  }
  if (!(residual_sq_ <= target * target)) report->bits |= kStepNotConverged;
}

}  // namespace adhesim
