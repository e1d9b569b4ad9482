#include "core/solve/implicit_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace adhesim {
namespace {

constexpr double kNewtonForcing = 1e-3;  // what a linear solve leaves of Newton's residual
constexpr double kSlopeLeft = 0.2;       // of the slope at the start, where a line search ends
constexpr int kSearchAttempts = 8;
constexpr double kRoundOff = 1e-15;  // of a force, relative to stiffness times position

}  // namespace

BlockMatrix ImplicitSolver::MatrixOf(const Model& model, const std::vector<StiffEffect>& effects) {
  BlockMatrix::Pattern pattern;
  for (const StiffEffect& stiff : effects) stiff.effect->AddPairs(&pattern);
  return BlockMatrix(model.particle_count(), std::move(pattern));
}

ImplicitSolver::ImplicitSolver(const Model& model, std::vector<StiffEffect> effects)
    : model_(model),
      effects_(std::move(effects)),
      matrix_(MatrixOf(model, effects_)),
      system_(model, matrix_),
      arcs_(model) {
  const std::size_t n = model.rest_position_m.size();
  int state_size = 0;
  for (const StiffEffect& stiff : effects_) {
    stiff.effect->UseMatrix(matrix_);
    damps_ = damps_ || (stiff.effect->force_kinds() & kDamping) != 0;
    state_size = std::max(state_size, stiff.state_first + stiff.effect->state_size());
  }
  effect_state_.assign(state_size, 0);
  for (std::size_t p = 0; p < n; ++p) {
    diagonal_.push_back(matrix_.Slot(static_cast<int>(p), static_cast<int>(p)));
  }
  for (auto* array : {&start_elastic_n_, &start_damping_n_, &start_total_n_, &elastic_n_,
                      &damping_n_, &position_m_, &velocity_m_s_, &arc_m_s_}) {
    array->assign(n, Vec3::Zero());
  }
  if (model.integrator == Integrator::kNewton) {
    explicit_n_.assign(n, Vec3::Zero());
    for (auto* array : {&newton_, &last_residual_ns_}) array->assign(n, Padded{});
  }
  for (auto* array : {&prescribed_m_s_, &change_m_s_, &residual_ns_, &direction_, &product_}) {
    array->assign(n, Padded{});
  }
}

bool ImplicitSolver::HasStiffness(int particle) const {
  return matrix_.row_start()[particle + 1] - matrix_.row_start()[particle] > 1;
}

ForceInput ImplicitSolver::InputOf(const StiffEffect& stiff, const ForceInput& all) const {
  ForceInput in = all;
  in.effect_state = all.effect_state.subspan(stiff.state_first, stiff.effect->state_size());
  return in;
}

void ImplicitSolver::Assemble(const ForceInput& all, double dt_s) {
  matrix_.SetZero();
  for (const StiffEffect& stiff : effects_) {
    stiff.effect->AddStiffness(InputOf(stiff, all), dt_s * dt_s, dt_s, &matrix_);
  }
  for (std::size_t p = 0; p < diagonal_.size(); ++p) {
    matrix_.Add(diagonal_[p], model_.mass_kg[p] * Mat3::Identity());
  }
  system_.InvertDiagonal(all.parallel);
}

// Into elastic_n_ and damping_n_; returns the energy.
double ImplicitSolver::EvaluateStiff(const ForceInput& all) {
  std::fill(elastic_n_.begin(), elastic_n_.end(), Vec3::Zero());
  std::fill(damping_n_.begin(), damping_n_.end(), Vec3::Zero());
  double energy_j = 0;
  for (const StiffEffect& stiff : effects_) {
    energy_j += stiff.effect->AddForces(InputOf(stiff, all), {elastic_n_, damping_n_, {}, {}});
  }
  return energy_j;
}

void ImplicitSolver::Begin(const State& state, std::span<const NearPair> near, const Forces& forces,
                           double dt_s, Parallel* parallel) {
  near_ = near;
  std::copy(forces.by_kind[0].begin(), forces.by_kind[0].end(), start_elastic_n_.begin());
  std::copy(forces.by_kind[1].begin(), forces.by_kind[1].end(), start_damping_n_.begin());
  std::copy(forces.total.begin(), forces.total.end(), start_total_n_.begin());
  std::copy_n(state.effect_state.begin(), effect_state_.size(), effect_state_.begin());
  const ForceInput in{state.position_m, state.velocity_m_s, state.time_s,
                      effect_state_,    parallel,           near,
                      /*trial=*/true};
  if (++assembled_ago_ >= effort_.stiffness_every || assembled_dt_s_ != dt_s) {
    Assemble(in, dt_s);
    assembled_dt_s_ = dt_s;
    assembled_ago_ = 0;
  }
  SetScale(state, dt_s);
  if (explicit_n_.empty()) {
    arcs_.Update(state, dt_s);
    return;
  }
  EvaluateStiff(in);
  for (std::size_t p = 0; p < explicit_n_.size(); ++p) {
    explicit_n_[p] = start_total_n_[p] - elastic_n_[p];
  }
}

// What residuals are measured against: the elastic forces on all particles, also those that are
// held. Beside it, what positions that are rounded leave in these forces.
void ImplicitSolver::SetScale(const State& state, double dt_s) {
  scale_ = dt_s * std::sqrt(system_.DiagonalNormSq(start_elastic_n_));
  double sum = 0;
  for (std::size_t p = 0; p < diagonal_.size(); ++p) {
    if (model_.fixed[p] || !(model_.mass_kg[p] > 0)) continue;
    const double all = matrix_.At(diagonal_[p]).trace(), stiffness = all - 3 * model_.mass_kg[p];
    const double velocity = state.position_m[p].norm() / dt_s + state.velocity_m_s[p].norm();
    sum += stiffness * stiffness / all * velocity * velocity;
  }
  round_off_ = kRoundOff * std::sqrt(sum);
}

void ImplicitSolver::Prescribe(const State& state, std::span<const RigidGroup> groups) {
  for (std::size_t p = 0; p < prescribed_m_s_.size(); ++p) {
    const int zone = state.contacts.zone_of[p];
    arc_m_s_[p].setZero();
    if (system_.active(static_cast<int>(p))) {
      if (zone < 0) arc_m_s_[p] = arcs_.At(model_.body_of[p], state.position_m[p]);
      prescribed_m_s_[p].Set(state.velocity_m_s[p] - arc_m_s_[p]);
    } else if (zone >= 0 && groups[zone].driven() && !model_.fixed[p]) {
      prescribed_m_s_[p].Set(groups[zone].VelocityAt(state.position_m[p]));
    } else {
      prescribed_m_s_[p] = Padded{};
    }
    change_m_s_[p] = Padded{};
  }
}

void ImplicitSolver::Solve(std::span<const RigidGroup> groups, double dt_s, State* state,
                           const Forces& forces, Parallel* parallel, StepReport* report) {
  system_.SetZones(*state, groups);
  Prescribe(*state, groups);
  iterations_ = 0;
  if (model_.integrator == Integrator::kNewton) {
    SolveNewton(groups, dt_s, *state, parallel, report);
  } else {
    SolveLinear(groups, dt_s, *state, parallel, report);
  }
  for (std::size_t p = 0; p < velocity_m_s_.size(); ++p) {
    velocity_m_s_[p] = prescribed_m_s_[p].vec() + change_m_s_[p].vec();
  }
  EffectiveForces(groups, dt_s, *state, forces, parallel);
  for (std::size_t p = 0; p < velocity_m_s_.size(); ++p) {
    state->velocity_change_m_s[p] = velocity_m_s_[p] + arc_m_s_[p] - state->velocity_m_s[p];
  }
}

void ImplicitSolver::StartResidual(std::span<const RigidGroup> groups, double dt_s,
                                   const State& state, Parallel* parallel,
                                   std::span<Padded> residual) {
  system_.SetZones(state, groups);
  Prescribe(state, groups);
  system_.Multiply(prescribed_m_s_, product_, parallel);
  for (int p = 0; p < model_.particle_count(); ++p) {
    residual[p] = Padded{};
    if (model_.fixed[p] || !(model_.mass_kg[p] > 0)) continue;
    const Vec3 product =
        system_.active(p) ? product_[p].vec() : system_.MultiplyRow(p, prescribed_m_s_);
    const Vec3 velocity = state.velocity_m_s[p] - arc_m_s_[p];
    residual[p].Set(model_.mass_kg[p] * velocity + dt_s * start_total_n_[p] - product);
  }
}

// In terms of u = v_{n+1} - c: A u = M (v_n - c) + dt f, f without the damping of stiff effects,
// which is linear.
void ImplicitSolver::SolveLinear(std::span<const RigidGroup> groups, double dt_s,
                                 const State& state, Parallel* parallel, StepReport* report) {
  system_.Multiply(prescribed_m_s_, product_, parallel);
  for (std::size_t p = 0; p < residual_ns_.size(); ++p) {
    residual_ns_[p] = Padded{};
    if (!system_.active(static_cast<int>(p))) continue;
    residual_ns_[p].Set(model_.mass_kg[p] * prescribed_m_s_[p].vec() + dt_s * start_total_n_[p] -
                        product_[p].vec());
  }
  const double start_sq = system_.Precondition(residual_ns_, direction_, parallel);
  const double scale = std::max(scale_, std::sqrt(start_sq));
  system_.Balance(change_m_s_, residual_ns_);
  StartFromLastChange(groups, state, parallel);
  const SubspaceSystem::Result result =
      system_.Solve(std::max(effort_.tolerance * scale, round_off_), model_.max_iterations,
                    change_m_s_, residual_ns_, parallel);
  iterations_ = result.iterations;
  system_.BalanceTurns(change_m_s_, residual_ns_, parallel);
  system_.Balance(change_m_s_, residual_ns_);
  residual_sq_ = system_.Precondition(residual_ns_, direction_, parallel);
  if (!result.converged) report->bits |= kStepNotConverged;
  // What is not a number must not look like rest.
  if (!std::isfinite(residual_sq_)) {
    for (Padded& change : change_m_s_) change.v[0] = std::numeric_limits<double>::quiet_NaN();
  }
}

// The last change of velocity, scaled to what serves best now: where motion goes on as it did, that
// is nearly the solution; otherwise next to nothing.
void ImplicitSolver::StartFromLastChange(std::span<const RigidGroup> groups, const State& state,
                                         Parallel* parallel) {
  for (std::size_t p = 0; p < direction_.size(); ++p) {
    direction_[p].Set(state.velocity_change_m_s[p]);
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

// r = dt f(x_n + dt v, v) - M (v - v_n) of the velocities tried, and its norm.
double ImplicitSolver::NewtonResidual(double dt_s, const State& state, Parallel* parallel) {
  for (std::size_t p = 0; p < velocity_m_s_.size(); ++p) {
    velocity_m_s_[p] = prescribed_m_s_[p].vec() + change_m_s_[p].vec();
    position_m_[p] = state.position_m[p] + dt_s * velocity_m_s_[p];
  }
  EvaluateStiff({position_m_, velocity_m_s_, state.time_s, effect_state_, parallel, near_, true});
  for (std::size_t p = 0; p < velocity_m_s_.size(); ++p) {
    residual_ns_[p] = Padded{};
    if (!system_.active(static_cast<int>(p))) continue;
    residual_ns_[p].Set(dt_s * (explicit_n_[p] + elastic_n_[p] + damping_n_[p]) -
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

// Newton's directions, made conjugate (Polak and Ribiere): the stiffness is that of a convex model,
// and where it is too stiff Newton alone would creep.
void ImplicitSolver::SolveNewton(std::span<const RigidGroup> groups, double dt_s,
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
  if (!std::isfinite(residual_sq_)) {
    for (Padded& change : change_m_s_) change.v[0] = std::numeric_limits<double>::quiet_NaN();
  }
}

void ImplicitSolver::EffectiveForces(std::span<const RigidGroup> groups, double dt_s,
                                     const State& state, const Forces& forces, Parallel* parallel) {
  const bool newton = model_.integrator == Integrator::kNewton;
  if (!newton) {
    for (std::size_t p = 0; p < product_.size(); ++p) product_[p].Set(velocity_m_s_[p]);
    if (damps_) {
      EvaluateStiff(
          {state.position_m, velocity_m_s_, state.time_s, effect_state_, parallel, near_, true});
    }
  }
  for (int p = 0; p < model_.particle_count(); ++p) {
    const Vec3 momentum = model_.mass_kg[p] * velocity_m_s_[p];
    if (system_.active(p) && state.contacts.zone_of[p] < 0) {
      forces.total[p] =
          (momentum + model_.mass_kg[p] * arc_m_s_[p] - model_.mass_kg[p] * state.velocity_m_s[p]) /
          dt_s;
    } else if (newton) {
      forces.total[p] = explicit_n_[p] + elastic_n_[p] + damping_n_[p];
    } else {
      forces.total[p] = start_total_n_[p] + (momentum - system_.MultiplyRow(p, product_)) / dt_s;
    }
  }
  MatchFreeZones(groups, dt_s, state, forces.total);
  for (int p = 0; p < model_.particle_count(); ++p) {
    const Vec3 damping = damps_ ? damping_n_[p] : Vec3::Zero();
    if (damps_) forces.by_kind[1][p] = start_damping_n_[p] + damping;
    forces.by_kind[0][p] = forces.total[p] - damping - (start_total_n_[p] - start_elastic_n_[p]);
  }
}

// A free zone's forces, too, lead to the velocities found: what is missing goes to its members by
// mass.
void ImplicitSolver::MatchFreeZones(std::span<const RigidGroup> groups, double dt_s,
                                    const State& state, std::span<Vec3> force_n) const {
  for (std::size_t z = 0; z < groups.size(); ++z) {
    const Zone& zone = state.contacts.zones[z];
    const RigidGroup& group = groups[z];
    const auto members = std::span(state.contacts.zone_members).subspan(zone.first, zone.count);
    Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();
    for (int p : members) {
      if (!system_.active(p)) continue;
      const Vec3 missing =
          model_.mass_kg[p] * (velocity_m_s_[p] - state.velocity_m_s[p]) - dt_s * force_n[p];
      impulse += missing;
      moment += (state.position_m[p] - group.pivot_m).cross(missing);
    }
    const Twist twist = group.Response(impulse, moment);
    for (int p : members) {
      if (!system_.active(p)) continue;
      force_n[p] +=
          (model_.mass_kg[p] / dt_s) *
          (twist.linear_m_s + twist.angular_rad_s.cross(state.position_m[p] - group.pivot_m));
    }
  }
}

}  // namespace adhesim
