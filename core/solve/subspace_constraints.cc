// The part of the solver that is about constraint rows, and sliding contacts in turns with them.

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/model/carried.h"
#include "core/solve/subspace_solver.h"

namespace adhesim {
namespace {

constexpr int kConstraintIterations = 12;  // the error shrinks by dt |W| an iteration: 3 is usual
constexpr double kFastConvergence = 0.1;   // an iteration leaves less than this: a series to sum
constexpr int kSlidePasses = 4;            // constraints and sliding contacts, in turns
constexpr int kSlideSweeps = 8;            // over the sliding contacts in one turn
constexpr int kMostSlidePasses = 32;  // while they would gain energy: sweeps have not converged
constexpr double kNearlyMet = 1e-10;  // relative volume; above it the step says so
constexpr double kDiverged = 1e3;     // relative volume
constexpr double kLacks = 1e-6;       // relative volume that is got back over several sub-steps;
                                      // what there is too much of is met at once
constexpr double kRegained = 0.1;     // of it in one

}  // namespace

void SubspaceSolver::FindGradients(std::span<const Vec3> position_m,
                                   std::span<const std::uint8_t> asleep) {
  for (const Effect* effect : constraints_) {
    effect->ConstraintGradients(position_m, asleep, gradient_);
  }
  GiveToCarriers(model_, gradient_);
}

void SubspaceSolver::FindResiduals(std::span<const Vec3> position_m,
                                   std::span<const std::uint8_t> asleep,
                                   std::span<double> residual) const {
  for (const Effect* effect : constraints_) {
    const std::size_t count = effect->constraints().size();
    effect->ConstraintResiduals(position_m, asleep, residual.first(count));
    residual = residual.subspan(count);
  }
}

void SubspaceSolver::CollectRows(const State& state) {
  if (!gradients_known_) {
    FindGradients(state.position_m, state.sleep.asleep);
    gradients_known_ = true;
  }
  for (int r = 0; r < rows_; ++r) {
    double free = 0, all = 0;
    if (Sleeps(state, r)) {
      diagonal_[r] = movable_[r] = 0;
      continue;
    }
    for (int p = row_[r].first; p < row_[r].first + row_[r].count; ++p) {
      response_[p] = gradient_[p].cwiseProduct(per_kg_[p]);
      const double mobility = gradient_[p].dot(response_[p]);
      all += mobility;
      if (state.contacts.zone_of[p] < 0) free += mobility;
    }
    diagonal_[r] = free;
    movable_[r] = all;
  }
  on_zone_.clear();
  for (int z = 0; z < static_cast<int>(groups_.size()); ++z) {
    const RigidGroup& group = groups_[z];
    if (group.driven() || group.freedom == RigidGroup::Freedom::kLocked) continue;
    int row = -1;  // members ascend, and so do their rows
    for (int p : Members(state.contacts, z)) {
      if (row_of_[p] < 0 || model_.fixed[p]) continue;
      if (row_of_[p] != row) {
        row = row_of_[p];
        on_zone_.push_back({row, z, Vec3::Zero(), Vec3::Zero()});
      }
      on_zone_.back().force += gradient_[p];
      on_zone_.back().moment += (state.position_m[p] - group.pivot_m).cross(gradient_[p]);
    }
  }
  preconditioner_ = diagonal_;
  for (const RowOnZone& part : on_zone_) {
    const Twist response = groups_[part.zone].Response(part.force, part.moment);
    preconditioner_[part.row] +=
        part.force.dot(response.linear_m_s) + part.moment.dot(response.angular_rad_s);
  }
  // A body whose every particle is held cannot change its volume: its row drops out.
  for (int r = 0; r < rows_; ++r) {
    if (!(preconditioner_[r] > 1e-12 * movable_[r])) preconditioner_[r] = 0;
  }
}

// y = G W G^T x: the rows' mobility, through free particles and through zones that couple bodies.
void SubspaceSolver::ApplyRows(std::span<const double> x, std::span<double> y) const {
  for (int r = 0; r < rows_; ++r) y[r] = diagonal_[r] * x[r];
  for (std::size_t i = 0; i < on_zone_.size();) {
    const int zone = on_zone_[i].zone;
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    std::size_t end = i;
    for (; end < on_zone_.size() && on_zone_[end].zone == zone; ++end) {
      if (preconditioner_[on_zone_[end].row] == 0) continue;
      force += on_zone_[end].force * x[on_zone_[end].row];
      moment += on_zone_[end].moment * x[on_zone_[end].row];
    }
    const Twist response = groups_[zone].Response(force, moment);
    for (; i < end; ++i) {
      y[on_zone_[i].row] += on_zone_[i].force.dot(response.linear_m_s) +
                            on_zone_[i].moment.dot(response.angular_rad_s);
    }
  }
}

// Conjugate gradients with a diagonal preconditioner: one row a body, coupled through few zones.
void SubspaceSolver::SolveRows(std::span<const double> rhs, std::span<double> x) {
  const auto dot = [&](const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0;
    for (int r = 0; r < rows_; ++r) sum += a[r] * b[r];
    return sum;
  };
  const auto precondition = [&] {
    for (int r = 0; r < rows_; ++r)
      cg_z_[r] = preconditioner_[r] > 0 ? cg_r_[r] / preconditioner_[r] : 0;
  };
  for (int r = 0; r < rows_; ++r) {
    x[r] = 0;
    cg_r_[r] = preconditioner_[r] > 0 ? rhs[r] : 0;
  }
  precondition();
  cg_p_ = cg_z_;
  double rz = dot(cg_r_, cg_z_);
  const double target = 1e-24 * rz;  // 1e-12 in the norm: the outer iteration does the rest
  for (int iteration = 0; iteration < 4 * rows_ + 16 && rz > target && rz > 0; ++iteration) {
    ApplyRows(cg_p_, cg_ap_);
    const double curvature = dot(cg_p_, cg_ap_);
    if (!(curvature > 0)) break;
    const double alpha = rz / curvature;
    for (int r = 0; r < rows_; ++r) {
      x[r] += alpha * cg_p_[r];
      cg_r_[r] -= preconditioner_[r] > 0 ? alpha * cg_ap_[r] : 0;
    }
    precondition();
    const double next = dot(cg_r_, cg_z_);
    for (int r = 0; r < rows_; ++r) cg_p_[r] = cg_z_[r] + (next / rz) * cg_p_[r];
    rz = next;
  }
}

void SubspaceSolver::AddMultipliers(std::span<const double> change) {
  for (int r = 0; r < rows_; ++r) multiplier_[r] += change[r];
  for (const RowOnZone& part : on_zone_) {
    groups_[part.zone].AddImpulse(part.force * change[part.row], part.moment * change[part.row]);
  }
}

// Ends the constraints' change at kicked_m_s_ (velocity form, notes 2.2).
void SubspaceSolver::StopConstraints(const State& state) {
  for (int r = 0; r < rows_; ++r) {
    residual_[r] = 0;
    if (Sleeps(state, r)) continue;
    for (int p = row_[r].first; p < row_[r].first + row_[r].count; ++p) {
      residual_[r] -= gradient_[p].dot(kicked_m_s_[p]);
    }
  }
  MeetAll(state, nullptr);
}

void SubspaceSolver::MeetSlides(const State& state) {
  for (int pass = 0;; ++pass) {
    KickAll(state);
    if (pass >= kSlidePasses && (pass >= kMostSlidePasses || !(SlidingWork(state) > 0))) return;
    if (rows_ > 0 || !ties_.empty()) {
      StopConstraints(state);
      KickAll(state);
    }
    for (int sweep = 0; sweep < kSlideSweeps; ++sweep) slides_.Sweep(state, {kicked_m_s_, groups_});
    // What the sweeps gave to free particles goes on from here.
    for (int p : slides_.particles()) {
      if (model_.fixed[p] || state.contacts.zone_of[p] >= 0) continue;
      free_m_s_[p] = kicked_m_s_[p] - ConstraintImpulse(p).cwiseProduct(per_kg_[p]);
    }
  }
}

// Impulses that have been met already.
void SubspaceSolver::GiveSlides(const State& state) {
  for (int p : slides_.particles()) {
    if (model_.fixed[p]) continue;
    const Vec3 impulse = slides_.ImpulseOn(p);
    const int zone = state.contacts.zone_of[p];
    if (zone < 0) {
      free_m_s_[p] += impulse.cwiseProduct(per_kg_[p]);
    } else {
      RigidGroup& group = groups_[zone];
      group.AddImpulse(impulse, (state.position_m[p] - group.pivot_m).cross(impulse));
    }
  }
}

// Of sliding contacts at kicked_m_s_, in pairs of surfaces: without what tools do.
double SubspaceSolver::SlidingWork(const State& state) const {
  double work_j = 0;
  for (int p : slides_.particles()) {
    work_j += 0.5 * slides_.ImpulseOn(p).dot(state.velocity_m_s[p] + kicked_m_s_[p]);
  }
  slides_.ForEachOnTool([&](const ContactRows::OnTool& on) { work_j -= on.work_j; });
  return work_j;
}

// The gradient is that of x_n, so that the error shrinks by a nearly constant factor. What the last
// iteration left of a row's error is that factor: the sum of the series (Aitken) saves an
// iteration.
void SubspaceSolver::Extrapolate(int iteration) {
  for (int r = 0; r < rows_; ++r) {
    const double measured = residual_[r];
    const double left = iteration > 0 && left_[r] != 0 ? measured / left_[r] : 0;
    if (std::abs(left) < kFastConvergence) residual_[r] *= 1 / (1 - left);
    left_[r] = measured;
  }
}

// Largest error of a row at moved_m_, relative; residual_ becomes the speeds that would end them.
double SubspaceSolver::MeasureRows(const State& state, double dt_s) {
  FindResiduals(moved_m_, state.sleep.asleep, residual_);
  double worst = 0;
  stuck_error_ = 0;
  for (int r = 0; r < rows_; ++r) {
    if (Sleeps(state, r)) residual_[r] = 0;
    residual_[r] -= lacking_[r];
    const double error = std::abs(residual_[r]) / row_[r].scale;
    double& largest = preconditioner_[r] > 0 ? worst : stuck_error_;
    if (!(error <= largest)) largest = error;
    residual_[r] /= -dt_s;
  }
  return worst;
}

// What turns far in a sub-step, or is nearly flat, may lead the iteration away: then the step takes
// the best it has seen, at worst the one without a correction.
void SubspaceSolver::MeetConstraints(const State& state, double dt_s, Parallel* parallel,
                                     StepReport* report) {
  double least = std::numeric_limits<double>::infinity();
  for (int iteration = 0;; ++iteration) {
    MoveAll(state, dt_s, parallel);
    const double worst = MeasureRows(state, dt_s);
    if (!(stuck_error_ < std::max(kNearlyMet, constraint_tolerance_)))
      report->bits |= kStepVolumeNotMet;
    if (worst < least) {
      least = worst;
      best_ = multiplier_;
    }
    if (worst <= constraint_tolerance_) return;
    // At the floor of round-off the error stops shrinking.
    if (iteration == kConstraintIterations || !(worst < kDiverged)) {
      if (!(least < kNearlyMet)) {
        report->bits |= kStepVolumeNotMet;
        rows_off_ = true;
      }
      if (worst == least) return;
      for (int r = 0; r < rows_; ++r) change_[r] = best_[r] - multiplier_[r];
      AddMultipliers(change_);
      MoveAll(state, dt_s, parallel);
      return;
    }
    Extrapolate(iteration);
    MeetAll(state, report);
  }
}

bool SubspaceSolver::RowsLack(const State& state) {
  FindResiduals(state.position_m, state.sleep.asleep, lacking_);
  rows_off_ = false;
  for (int r = 0; r < rows_; ++r) {
    if (Sleeps(state, r) || !(-lacking_[r] > kLacks * row_[r].scale)) lacking_[r] = 0;
    rows_off_ = rows_off_ || lacking_[r] != 0;
  }
  return rows_off_;
}

void SubspaceSolver::RegainRows(double most_m, State* state) {
  FindGradients(state->position_m, state->sleep.asleep);
  for (int r = 0; r < rows_; ++r) {
    if (lacking_[r] == 0) continue;
    const auto way = [&](int p) -> Vec3 {
      return state->contacts.zone_of[p] < 0 ? Vec3(gradient_[p].cwiseProduct(per_kg_[p]))
                                            : Vec3::Zero();
    };
    const int end = row_[r].first + row_[r].count;
    double mobility = 0, longest = 0;
    for (int p = row_[r].first; p < end; ++p) {
      mobility += way(p).dot(gradient_[p]);
      longest = std::max(longest, way(p).norm());
    }
    if (!(mobility > 0)) continue;
    double factor = kRegained * lacking_[r] / mobility;
    const double far = std::abs(factor) * longest;
    if (far > most_m) factor *= most_m / far;
    for (int p = row_[r].first; p < end; ++p) state->position_m[p] -= factor * way(p);
  }
  Carry(model_, state->position_m);
  gradients_known_ = false;
  RowsLack(*state);
}

void SubspaceSolver::CorrectPositions(std::span<Vec3> position_m) {
  gradients_known_ = false;
  for (int iteration = 0; iteration < kConstraintIterations && rows_ > 0; ++iteration) {
    FindGradients(position_m, {});
    FindResiduals(position_m, {}, residual_);
    double worst = 0;
    for (int r = 0; r < rows_; ++r) {
      double mobility = 0;
      for (int p = row_[r].first; p < row_[r].first + row_[r].count; ++p) {
        mobility += gradient_[p].cwiseProduct(per_kg_[p]).dot(gradient_[p]);
      }
      if (!(mobility > 0)) continue;
      worst = std::max(worst, std::abs(residual_[r]) / row_[r].scale);
      for (int p = row_[r].first; p < row_[r].first + row_[r].count; ++p) {
        position_m[p] -= residual_[r] / mobility * gradient_[p].cwiseProduct(per_kg_[p]);
      }
    }
    Carry(model_, position_m);
    if (worst <= kConstraintTolerance) return;
  }
}

}  // namespace adhesim
