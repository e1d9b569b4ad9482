// The part of the implicit solver that is about linear steps.

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/solve/implicit_solver.h"

namespace adhesim {

// What just turning changes of forces that were made linear, with the sign of A's product: tissue
// in which there is stress has stiffness against it (K (w x r) = -w x f where K is exact), which is
// no force of a step that goes from tangent to tangent: f itself leads from one chord to the next.
// Turned with the body, it took angular momentum by a^2 a step. Of bodies whose motion is a turn
// above all: of one that snaps back, K tells nothing that exact.
void ImplicitSolver::FindTurning(const State& state) {
  for (int p = 0; p < model_.particle_count(); ++p) {
    direction_[p].Set(arcs_.Turning(model_.body_of[p], state.position_m[p]));
    turning_ns_[p].setZero();
  }
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    if (!arcs_.turns(static_cast<int>(b))) continue;
    const int first = model_.bodies[b].first_particle;
    const int end = first + model_.bodies[b].particle_count;
    double mass_kg = 0, turn_j = 0, other_j = 0;  // twice these energies
    Vec3 momentum = Vec3::Zero();
    for (int p = first; p < end; ++p) {
      const double m = model_.mass_kg[p];
      const Vec3 other = state.velocity_m_s[p] - direction_[p].vec();
      mass_kg += m;
      momentum += m * other;
      turn_j += m * direction_[p].vec().squaredNorm();
      other_j += m * other.squaredNorm();
    }
    if (!(turn_j >= other_j - momentum.squaredNorm() / mass_kg)) continue;
    for (int p = first; p < end; ++p) {
      if (model_.fixed[p]) continue;
      turning_ns_[p] = system_.MultiplyRow(p, direction_) - model_.mass_kg[p] * direction_[p].vec();
    }
  }
}

// What the linear equation asks of A u, but for what is met within it: u = v_{n+1} - c, f without
// the damping of stiff effects, which is linear.
Vec3 ImplicitSolver::Asked(int p, double dt_s, const State& state) const {
  return model_.mass_kg[p] * (state.velocity_m_s[p] - arc_m_s_[p]) + dt_s * start_total_n_[p] +
         turning_ns_[p];
}

void ImplicitSolver::LinearResidual(double dt_s, const State& state, Parallel* parallel) {
  for (std::size_t p = 0; p < direction_.size(); ++p) {
    for (int k = 0; k < 3; ++k) {
      direction_[p].v[k] = prescribed_m_s_[p].v[k] + change_m_s_[p].v[k];
    }
  }
  system_.Multiply(direction_, product_, parallel);
  for (std::size_t p = 0; p < residual_ns_.size(); ++p) {
    residual_ns_[p] = Padded{};
    if (!system_.active(static_cast<int>(p))) continue;
    residual_ns_[p].Set(Asked(static_cast<int>(p), dt_s, state) +
                        InnerImpulse(static_cast<int>(p)) - product_[p].vec());
  }
}

void ImplicitSolver::SolveLinear(std::span<const RigidGroup> groups, double dt_s,
                                 const State& state, Parallel* parallel, StepReport* report) {
  const bool slides = CollectSlides(groups, dt_s, state);
  LinearResidual(dt_s, state, parallel);
  const double start_sq = system_.Precondition(residual_ns_, direction_, parallel);
  const double scale = std::max(scale_, std::sqrt(start_sq));
  system_.Balance(change_m_s_, residual_ns_);
  StartFromLastChange(groups, state, parallel);
  const SubspaceSystem::Result result =
      system_.Solve(std::max(effort_.tolerance * scale, round_off_), model_.max_iterations,
                    change_m_s_, residual_ns_, parallel);
  iterations_ = result.iterations;
  BalanceLinear(dt_s, state, parallel);
  if (!rows_.empty()) {
    MeetRows(dt_s, state, parallel, report);
    LinearResidual(dt_s, state, parallel);
    system_.Balance(change_m_s_, residual_ns_);
  }
  if (slides) {
    for (int turn = 0; turn < (rows_.empty() ? 1 : kSlideTurns); ++turn) {
      MeetSlides(groups, std::max(effort_.tolerance * scale, round_off_), state, parallel, report);
      BalanceLinear(dt_s, state, parallel);
      if (rows_.empty()) break;
      MeetRows(dt_s, state, parallel, report);
      LinearResidual(dt_s, state, parallel);
      system_.Balance(change_m_s_, residual_ns_);
    }
  }
  residual_sq_ = system_.Precondition(residual_ns_, direction_, parallel);
  if (!result.converged) report->bits |= kStepNotConverged;
  // What is not a number must not look like rest.
  if (!std::isfinite(residual_sq_)) {
    for (Padded& change : change_m_s_) change.v[0] = std::numeric_limits<double>::quiet_NaN();
  }
}

// A u of what can move is what the equation asks for, less what is open and what is held: no
// product.
void ImplicitSolver::BalanceLinear(double dt_s, const State& state, Parallel* parallel) {
  for (std::size_t p = 0; p < direction_.size(); ++p) {
    direction_[p] = product_[p] = Padded{};
    if (!system_.active(static_cast<int>(p))) continue;
    direction_[p].Set(prescribed_m_s_[p].vec() + change_m_s_[p].vec());
    product_[p].Set(Asked(static_cast<int>(p), dt_s, state) + InnerImpulse(static_cast<int>(p)) -
                    residual_ns_[p].vec());
  }
  system_.SubtractHeld(prescribed_m_s_, product_);
  system_.BalanceWork(direction_, product_, change_m_s_, residual_ns_, parallel);
}

// What is nearly flat, or turns far in a sub-step, may lead the iteration away: then the best is
// kept, and the rest of the step says what it could not mend.
void ImplicitSolver::MeetRows(double dt_s, const State& state, Parallel* parallel,
                              StepReport* report) {
  iterations_ +=
      rows_.Respond(effort_.tolerance, model_.max_iterations, &system_, parallel, report);
  double last = std::numeric_limits<double>::infinity();
  for (int iteration = 0;; ++iteration) {
    const double worst = MeasureRows(dt_s, state);
    if (worst <= kRowTolerance || iteration == kRowIterations) return;
    if (!(worst < last)) {
      if (iteration > 0) rows_.GoBack(change_m_s_, residual_ns_);
      return;
    }
    last = worst;
    rows_.Advance(change_m_s_, residual_ns_);
  }
}

// The last change of velocity, scaled to what serves best now: where motion goes on as it did, that
// is nearly the solution; otherwise next to nothing.
void ImplicitSolver::StartFromLastChange(std::span<const RigidGroup> groups, const State& state,
                                         Parallel* parallel) {
  for (std::size_t p = 0; p < direction_.size(); ++p) {
    const Vec3 turned = prescribed_m_s_[p].vec() - state.velocity_m_s[p] + arc_m_s_[p];
    direction_[p].Set(state.velocity_change_m_s[p]);
    if (system_.active(static_cast<int>(p)))
      direction_[p].Set(state.velocity_change_m_s[p] - turned);
  }
  system_.Project(state, groups, direction_);
  const double curvature = system_.Multiply(direction_, product_, parallel);
  double descent = 0;
  for (std::size_t p = 0; p < direction_.size(); ++p) {
    for (int k = 0; k < 3; ++k) descent += direction_[p].v[k] * residual_ns_[p].v[k];
  }
  const double factor = descent / curvature;
  if (!(curvature > 0) || !std::isfinite(factor)) return;
  for (std::size_t p = 0; p < direction_.size(); ++p) {
    for (int k = 0; k < 3; ++k) {
      change_m_s_[p].v[k] += factor * direction_[p].v[k];
      residual_ns_[p].v[k] -= factor * product_[p].v[k];
    }
  }
}

}  // namespace adhesim
