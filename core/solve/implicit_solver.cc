#include "core/solve/implicit_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace adhesim {
namespace {

// rad: a free body that turns by more in a step needs stiffness of its own, whatever was given up.
// The one of the step before, 0.06 rad behind, spun a ball of 7 MPa up a billionfold.
constexpr double kMostTurned = 0.001;
// Two particles that move by more than this part of their distance at rest against each other in a
// step: forces made linear at its start tell nothing of its end. A bar that snaps back from ten
// times its length gained 58 % in energy, and tangled.
constexpr double kFar = 0.5;
constexpr double kRoundOff = 1e-15;  // of a force, relative to stiffness times position

}  // namespace

BlockMatrix ImplicitSolver::MatrixOf(const Model& model, const std::vector<StiffEffect>& effects) {
  BlockMatrix::Pattern pattern;
  for (const StiffEffect& stiff : effects) stiff.effect->AddPairs(&pattern);
  return BlockMatrix(model.particle_count(), std::move(pattern));
}

ImplicitSolver::ImplicitSolver(const Model& model, std::vector<StiffEffect> effects,
                               std::vector<const Effect*> constraints)
    : model_(model),
      effects_(std::move(effects)),
      matrix_(MatrixOf(model, effects_)),
      system_(model, matrix_),
      rows_(model, std::move(constraints)),
      arcs_(model) {
  const std::size_t n = model.rest_position_m.size();
  int state_size = 0;
  for (const StiffEffect& stiff : effects_) {
    stiff.effect->UseMatrix(matrix_);
    damps_ = damps_ || (stiff.effect->force_kinds() & kDamping) != 0;
    state_size = std::max(state_size, stiff.state_first + stiff.effect->state_size());
  }
  effect_state_.assign(state_size, 0);
  nearest_m_ = std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < n; ++p) {
    for (std::int32_t k = matrix_.row_start()[p]; k < matrix_.row_start()[p + 1]; ++k) {
      const std::size_t q = matrix_.column()[k];
      if (q == p) continue;
      nearest_m_ =
          std::min(nearest_m_, (model.rest_position_m[p] - model.rest_position_m[q]).norm());
    }
    diagonal_.push_back(matrix_.Slot(static_cast<int>(p), static_cast<int>(p)));
  }
  for (auto* array : {&start_elastic_n_, &start_damping_n_, &start_total_n_, &elastic_n_,
                      &damping_n_, &position_m_, &velocity_m_s_, &arc_m_s_, &turning_ns_}) {
    array->assign(n, Vec3::Zero());
  }
  explicit_n_.assign(n, Vec3::Zero());
  for (auto* array : {&newton_, &last_residual_ns_}) array->assign(n, Padded{});
  if (damps_) damped_m_s_.assign(n, Vec3::Zero());
  if (!rows_.empty()) without_rows_m_s_.assign(n, Padded{});
  groups_at_change_.reserve(n);
  for (auto* array : {&prescribed_m_s_, &change_m_s_, &residual_ns_, &direction_, &product_}) {
    array->assign(n, Padded{});
  }
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
  arcs_.Update(state, start_total_n_, dt_s);
  by_newton_ = model_.integrator == Integrator::kNewton;
  if (++assembled_ago_ >= effort_.stiffness_every || assembled_dt_s_ != dt_s ||
      arcs_.widest_rad() > kMostTurned) {
    Assemble(in, dt_s);
    assembled_dt_s_ = dt_s;
    assembled_ago_ = 0;
  }
  SetScale(state, dt_s);
  if (!rows_.empty()) rows_.Begin(state.position_m);
  if (by_newton_) {
    StartNewton(in);
  } else {
    FindTurning(state);
  }
}

void ImplicitSolver::GiveBack(const Forces& forces) const {
  std::copy(start_elastic_n_.begin(), start_elastic_n_.end(), forces.by_kind[0].begin());
  if (damps_)
    std::copy(start_damping_n_.begin(), start_damping_n_.end(), forces.by_kind[1].begin());
  std::copy(start_total_n_.begin(), start_total_n_.end(), forces.total.begin());
}

void ImplicitSolver::StartNewton(const ForceInput& in) {
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
      Vec3 start = state.velocity_m_s[p];
      if (zone < 0 && !by_newton_) {
        const Vec3& x = state.position_m[p];
        arc_m_s_[p] = arcs_.At(model_.body_of[p], x);
        start += arcs_.AtEnd(model_.body_of[p], x);
      }
      prescribed_m_s_[p].Set(start);
    } else if (zone >= 0 && groups[zone].driven() && !model_.fixed[p]) {
      prescribed_m_s_[p].Set(groups[zone].VelocityAt(state.position_m[p]));
    } else {
      prescribed_m_s_[p] = Padded{};
    }
    change_m_s_[p] = Padded{};
  }
}

// Whether some two particles that act on each other come by more than a part of their distance at
// rest nearer or further, by the velocities found.
bool ImplicitSolver::MovesFarWithin(double dt_s) const {
  const auto velocity = [this](int p) -> Vec3 {
    return prescribed_m_s_[p].vec() + change_m_s_[p].vec();
  };
  double fastest_sq = 0;
  for (int p = 0; p < model_.particle_count(); ++p) {
    fastest_sq = std::max(fastest_sq, velocity(p).squaredNorm());
  }
  if (2 * dt_s * std::sqrt(fastest_sq) <= kFar * nearest_m_) return false;
  const std::span<const std::int32_t> start = matrix_.row_start(), column = matrix_.column();
  for (int p = 0; p < model_.particle_count(); ++p) {
    for (std::int32_t k = start[p]; k < start[p + 1] && column[k] < p; ++k) {
      const int q = column[k];
      const double moved_sq = dt_s * dt_s * (velocity(p) - velocity(q)).squaredNorm();
      const Vec3 apart_m = model_.rest_position_m[p] - model_.rest_position_m[q];
      if (moved_sq > kFar * kFar * apart_m.squaredNorm()) return true;
    }
  }
  return false;
}

// Whether stiff effects and motion together have more energy after the step than before, but for
// what other forces do in it.
bool ImplicitSolver::GainsEnergy(const ForceInput& start, double dt_s) {
  double gained_j = -EvaluateStiff(start);
  for (int p = 0; p < model_.particle_count(); ++p) {
    const Vec3 velocity = prescribed_m_s_[p].vec() + change_m_s_[p].vec() + arc_m_s_[p];
    position_m_[p] = start.position_m[p] + dt_s * velocity;
    velocity_m_s_[p] = velocity;
    if (!system_.active(p)) continue;
    const double speeds = velocity.squaredNorm() - start.velocity_m_s[p].squaredNorm();
    gained_j += 0.5 * model_.mass_kg[p] * speeds;
    gained_j -= dt_s * velocity.dot(start_total_n_[p] - start_elastic_n_[p]);
  }
  ForceInput end = start;
  end.position_m = position_m_;
  end.velocity_m_s = velocity_m_s_;
  return gained_j + EvaluateStiff(end) > 0;
}

void ImplicitSolver::Solve(std::span<const RigidGroup> groups, double dt_s, State* state,
                           const Forces& forces, Parallel* parallel, StepReport* report,
                           const SlidingContacts& slides) {
  slides_ = slides;
  if (slides_.rows) slides_.rows->Clear();
  system_.SetZones(*state, groups);
  Prescribe(*state, groups);
  iterations_ = 0;
  rows_.Start();
  if (!by_newton_) {
    SolveLinear(groups, dt_s, *state, parallel, report);
    const ForceInput start{
        state->position_m, state->velocity_m_s, state->time_s, effect_state_, parallel, near_,
        /*trial=*/true};
    if (MovesFarWithin(dt_s) && GainsEnergy(start, dt_s)) {  // again, not by one linear system
      by_newton_ = true;
      assembled_dt_s_ = 0;  // A becomes that of the iterates
      StartNewton(start);
      Prescribe(*state, groups);
      rows_.Start();
      if (slides_.rows) slides_.rows->Clear();
    }
  }
  if (by_newton_) SolveNewton(groups, dt_s, *state, parallel, report);
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
    residual[p].Set(Asked(p, dt_s, state) - product);
  }
}

// The worst row's relative error where the velocities found lead.
double ImplicitSolver::MeasureRows(double dt_s, const State& state) {
  for (std::size_t p = 0; p < position_m_.size(); ++p) {
    const Vec3 velocity = prescribed_m_s_[p].vec() + change_m_s_[p].vec() + arc_m_s_[p];
    position_m_[p] = state.position_m[p] + dt_s * velocity;
  }
  return rows_.Measure(dt_s, position_m_);
}

void ImplicitSolver::EffectiveForces(std::span<const RigidGroup> groups, double dt_s,
                                     const State& state, const Forces& forces, Parallel* parallel) {
  if (!by_newton_) {
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
          (momentum + model_.mass_kg[p] * (arc_m_s_[p] - state.velocity_m_s[p]) - InnerImpulse(p)) /
          dt_s;
    } else if (by_newton_) {
      forces.total[p] = explicit_n_[p] + elastic_n_[p] + damping_n_[p];
    } else {
      forces.total[p] =
          start_total_n_[p] + (momentum + turning_ns_[p] - system_.MultiplyRow(p, product_)) / dt_s;
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
// mass. In a zone that turns about a pin this has a sum, which the pins take: forces inside a body
// have none.
void ImplicitSolver::MatchFreeZones(std::span<const RigidGroup> groups, double dt_s,
                                    const State& state, std::span<Vec3> force_n) const {
  for (std::size_t z = 0; z < groups.size(); ++z) {
    const Zone& zone = state.contacts.zones[z];
    const RigidGroup& group = groups[z];
    const auto members = std::span(state.contacts.zone_members).subspan(zone.first, zone.count);
    Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();
    for (int p : members) {
      if (!system_.active(p)) continue;
      const Vec3 missing = model_.mass_kg[p] * (velocity_m_s_[p] - state.velocity_m_s[p]) -
                           dt_s * force_n[p] - InnerImpulse(p);
      impulse += missing;
      moment += (state.position_m[p] - group.pivot_m).cross(missing);
    }
    const Twist twist = group.Response(impulse, moment);
    Vec3 sum = Vec3::Zero();
    int pins = 0;
    for (int p : members) {
      pins += model_.fixed[p];
      if (!system_.active(p)) continue;
      const Vec3 force =
          (model_.mass_kg[p] / dt_s) *
          (twist.linear_m_s + twist.angular_rad_s.cross(state.position_m[p] - group.pivot_m));
      force_n[p] += force;
      sum += force;
    }
    for (int p : members) {
      if (model_.fixed[p]) force_n[p] -= sum / pins;
    }
  }
}

}  // namespace adhesim
