// The part of the solver that is about ties: their rows and the constraints' in one system.

#include <algorithm>

#include "core/solve/subspace_solver.h"

namespace adhesim {
namespace {

constexpr double kToleranceSq = 1e-24;  // in the norm of the preconditioner, 1e-12
constexpr int kIterations = 200;

}  // namespace

// y = G W G^T x, with G the constraints' gradients and then the ties', W the mobility of free
// particles and zones.
void SubspaceSolver::ApplyAll(const State& state, std::span<const double> x, std::span<double> y) {
  const std::span<const double> ties_x = x.subspan(rows_), rows_x = x.first(rows_);
  ties_.Scatter(ties_x, tie_scratch_ns_);
  zone_wrench_.assign(groups_.size(), Wrench{});
  for (const RowOnZone& part : on_zone_) {
    if (preconditioner_[part.row] == 0) continue;
    zone_wrench_[part.zone].force_n += part.force * rows_x[part.row];
    zone_wrench_[part.zone].torque_nm += part.moment * rows_x[part.row];
  }
  for (int p : ties_.particles()) {
    const int zone = state.contacts.zone_of[p];
    if (zone < 0 || model_.fixed[p]) continue;
    const Vec3 r = state.position_m[p] - groups_[zone].pivot_m;
    zone_wrench_[zone].force_n += tie_scratch_ns_[p];
    zone_wrench_[zone].torque_nm += r.cross(tie_scratch_ns_[p]);
  }
  zone_response_.clear();
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    zone_response_.push_back(
        groups_[z].Response(zone_wrench_[z].force_n, zone_wrench_[z].torque_nm));
  }
  for (int r = 0; r < rows_; ++r) y[r] = diagonal_[r] * rows_x[r];
  for (int p : ties_.particles()) {
    const int zone = state.contacts.zone_of[p];
    Vec3 velocity = Vec3::Zero();
    if (!model_.fixed[p] && zone >= 0) {
      const Vec3 r = state.position_m[p] - groups_[zone].pivot_m;
      velocity = zone_response_[zone].linear_m_s + zone_response_[zone].angular_rad_s.cross(r);
    } else if (!model_.fixed[p]) {
      velocity = tie_scratch_ns_[p].cwiseProduct(per_kg_[p]);
      if (const int row = row_of_.empty() ? -1 : row_of_[p]; row >= 0 && preconditioner_[row] > 0) {
        y[row] += gradient_[p].dot(velocity);
        velocity += rows_x[row] * response_[p];
      }
    }
    tie_scratch_ns_[p] = velocity;  // from here on a velocity
  }
  for (const RowOnZone& part : on_zone_) {
    y[part.row] += part.force.dot(zone_response_[part.zone].linear_m_s) +
                   part.moment.dot(zone_response_[part.zone].angular_rad_s);
  }
  for (int r = 0; r < rows_; ++r) {
    if (preconditioner_[r] == 0) y[r] = 0;
  }
  ties_.Gather(tie_scratch_ns_, y.subspan(rows_));
  ties_.AddGiving(ties_x, y.subspan(rows_));
}

// Conjugate gradients from zero, preconditioned by rows of constraints and blocks of ties.
void SubspaceSolver::SolveAll(const State& state, std::span<const double> rhs, double least_sq,
                              std::span<double> x, StepReport* report) {
  const std::size_t n = rhs.size();
  const auto dot = [n](const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
  };
  double rows_rz = 0, ties_rz = 0;
  const auto precondition = [&] {
    rows_rz = 0;
    for (int r = 0; r < rows_; ++r) {
      cg_z_[r] = preconditioner_[r] > 0 ? cg_r_[r] / preconditioner_[r] : 0;
      rows_rz += cg_r_[r] * cg_z_[r];
    }
    ties_rz = ties_.Precondition(std::span<const double>(cg_r_).subspan(rows_),
                                 std::span<double>(cg_z_).subspan(rows_));
    return rows_rz + ties_rz;
  };
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = 0;
    const bool drops = i < static_cast<std::size_t>(rows_) && preconditioner_[i] == 0;
    cg_r_[i] = drops ? 0 : rhs[i];
  }
  double rz = precondition();
  std::copy_n(cg_z_.begin(), n, cg_p_.begin());
  const double target = kToleranceSq * std::max(rz, least_sq), rows_target = kToleranceSq * rows_rz;
  const auto left = [&] {
    return rz > target && (ties_rz > ties_.round_off() || rows_rz > rows_target);
  };
  int iteration = 0;
  for (; iteration < kIterations && left(); ++iteration) {
    ApplyAll(state, cg_p_, cg_ap_);
    const double curvature = dot(cg_p_, cg_ap_);
    if (!(curvature > 0)) break;
    const double alpha = rz / curvature;
    for (std::size_t i = 0; i < n; ++i) {
      x[i] += alpha * cg_p_[i];
      cg_r_[i] -= alpha * cg_ap_[i];
    }
    const double next = precondition();
    for (std::size_t i = 0; i < n; ++i) cg_p_[i] = cg_z_[i] + (next / rz) * cg_p_[i];
    rz = next;
  }
  if (iteration == kIterations && report) report->bits |= kStepNotConverged;
}

// The impulses of the last sub-step, as they are.
void SubspaceSolver::StartTies(const State& state) {
  std::fill(change_.begin(), change_.begin() + rows_, 0.0);
  std::copy(ties_.start().begin(), ties_.start().end(), change_.begin() + rows_);
  AddTies(state);
}

// Gives the ties' part of `change_` to particles and zones.
void SubspaceSolver::AddTies(const State& state) {
  const std::span<const double> change =
      std::span<const double>(change_).subspan(rows_, ties_.rows());
  ties_.Scatter(change, tie_scratch_ns_);
  ties_.Add(change, tie_scratch_ns_);
  for (int p : ties_.particles()) {
    if (model_.fixed[p]) continue;
    const int zone = state.contacts.zone_of[p];
    if (zone < 0) {
      free_m_s_[p] += tie_scratch_ns_[p].cwiseProduct(per_kg_[p]);
    } else {
      groups_[zone].AddImpulse(
          tie_scratch_ns_[p],
          (state.position_m[p] - groups_[zone].pivot_m).cross(tie_scratch_ns_[p]));
    }
  }
}

// Ends what `residual_` says of the constraints and what the ties lack, together.
void SubspaceSolver::MeetAll(const State& state, StepReport* report) {
  if (ties_.empty()) {
    SolveRows(residual_, change_);
    AddMultipliers(change_);
    return;
  }
  for (int p : ties_.particles()) {
    const int zone = state.contacts.zone_of[p], row = row_of_.empty() ? -1 : row_of_[p];
    Vec3& velocity = tie_scratch_ns_[p];
    if (model_.fixed[p]) {
      velocity.setZero();
    } else if (zone >= 0) {
      velocity = groups_[zone].VelocityAt(state.position_m[p]);
    } else {
      velocity = free_m_s_[p];
      if (row >= 0) velocity += multiplier_[row] * response_[p];
    }
  }
  const std::size_t n = rows_ + ties_.rows();
  const std::span<double> missing = std::span(all_rhs_).first(n);
  std::copy_n(residual_.begin(), rows_, missing.begin());
  ties_.Gather(tie_scratch_ns_, missing.subspan(rows_));
  ties_.Missing(missing.subspan(rows_), missing.subspan(rows_));
  SolveAll(state, missing, ties_.BlockNorm(ties_.start()), std::span(change_).first(n), report);
  AddMultipliers(std::span<const double>(change_).first(rows_));
  AddTies(state);
}

}  // namespace adhesim
