#include "core/solve/subspace_solver.h"

#include <algorithm>
#include <cmath>

#include "core/model/carried.h"
#include "core/solve/ledger.h"

namespace adhesim {
namespace {

constexpr double kConstraintTolerance = 1e-13;  // relative volume; round-off of the volume is 1e-15
constexpr double kNearlyMet = 1e-10;            // relative volume; above it the step says so
constexpr double kDiverged = 1e3;               // relative volume
constexpr int kConstraintIterations = 12;  // the error shrinks by dt |W| an iteration: 3 is usual
constexpr double kFastConvergence = 0.1;   // an iteration leaves less than this: a series to sum
constexpr int kSlidePasses = 4;            // constraints and sliding contacts, in turns
constexpr int kSlideSweeps = 8;            // over the sliding contacts in one turn
constexpr int kGrain = 4096;               // particles: about 20 us of work
constexpr int kPartParticles = 512;        // at most, of one part

// An array of vectors as the numbers it holds, for loops that treat all three alike.
double* Flat(std::vector<Vec3>& vectors) { return vectors.empty() ? nullptr : vectors[0].data(); }
const double* Flat(std::span<const Vec3> vectors) {
  return vectors.empty() ? nullptr : vectors[0].data();
}

}  // namespace

SubspaceSolver::SubspaceSolver(const Model& model, std::vector<const Effect*> constraints)
    : model_(model), constraints_(std::move(constraints)), slides_(model) {
  const std::size_t n = model.rest_position_m.size();
  for (auto* array : {&kicked_m_s_, &moved_m_, &moved_velocity_m_s_, &load_n_, &free_m_s_}) {
    array->assign(n, Vec3::Zero());
  }
  groups_.reserve(n);
  zone_response_.reserve(n);
  for (const Effect* effect : constraints_) {
    for (const ConstraintRow& row : effect->constraints()) row_.push_back(row);
  }
  rows_ = static_cast<int>(row_.size());
  old_twist_.resize(model.tools.size());
  per_kg_.resize(n);
  if (!model.carried.empty()) carried_area_m2_.assign(n, 0);
  for (std::size_t p = 0; p < n; ++p) {
    const bool moves_by_itself = !model.fixed[p] && model.mass_kg[p] > 0;
    per_kg_[p].setConstant(moves_by_itself ? 1 / model.mass_kg[p] : 0);
  }
  if (rows_ > 0) {
    row_of_.assign(n, -1);
    gradient_.assign(n, Vec3::Zero());
    response_.assign(n, Vec3::Zero());
  }
  for (int r = 0; r < rows_; ++r) {
    for (int p = row_[r].first; p < row_[r].first + row_[r].count; ++p) row_of_[p] = r;
  }
  MakeParts();
  if (rows_ == 0) return;
  on_zone_.reserve(n);
  for (auto* array : {&multiplier_, &diagonal_, &movable_, &preconditioner_, &residual_, &left_,
                      &change_, &best_, &cg_r_, &cg_p_, &cg_ap_, &cg_z_}) {
    array->assign(rows_, 0);
  }
}

void SubspaceSolver::MakeParts() {
  for (int p = 0; p < model_.particle_count(); ++p) {
    const int row = row_of_.empty() ? -1 : row_of_[p];
    if (parts_.empty() || parts_.back().row != row || parts_.back().count == kPartParticles) {
      parts_.push_back({p, 0, row});
    }
    ++parts_.back().count;
  }
  part_grain_ = 1 + static_cast<int>(parts_.size() * std::size_t{kGrain} / (1 + per_kg_.size()));
}

void SubspaceSolver::FormGroups(const State& state, std::span<const Twist> tool_twist) {
  groups_.clear();
  for (int z = 0; z < static_cast<int>(state.contacts.zones.size()); ++z) {
    const int tool = state.contacts.zones[z].tool;
    groups_.push_back(RigidGroup::Of(Members(state.contacts, z), state.position_m, model_.mass_kg,
                                     model_.fixed, tool >= 0 ? &state.tools[tool].pose : nullptr));
    if (tool >= 0) groups_.back().twist = tool_twist[tool];
  }
}

void SubspaceSolver::Capture(State* state, std::span<Wrench> tool_impulse) {
  for (std::size_t t = 0; t < old_twist_.size(); ++t) old_twist_[t] = state->tools[t].twist;
  FormGroups(*state, old_twist_);
  for (int p = 0; p < model_.particle_count(); ++p) {
    free_m_s_[p] = model_.fixed[p] ? Vec3::Zero() : state->velocity_m_s[p];
  }
  ProjectGroups(*state);
  if (rows_ > 0) {
    // Sticking may have left a volume changing: the plastic impact ends that too.
    CollectRows(*state);
    std::fill(multiplier_.begin(), multiplier_.end(), 0);
    KickAll(*state);
    StopConstraints();
  }
  KickAll(*state);
  BookCapture(model_, *this, state, tool_impulse);
  state->velocity_m_s = kicked_m_s_;
  StoreMomenta(state);
}

void SubspaceSolver::Try(const State& state, std::span<const Vec3> force_n, double dt_s,
                         Parallel* parallel, StepReport* report) {
  parallel->VectorFor(model_.particle_count(), kGrain, [&](int begin, int end) {
    const double *v = Flat(state.velocity_m_s), *f = Flat(force_n), *per_kg = Flat(per_kg_);
    double* free = Flat(free_m_s_);
    for (int i = 3 * begin; i < 3 * end; ++i) free[i] = v[i] + (dt_s * per_kg[i]) * f[i];
  });
  ProjectGroups(state);
  if (rows_ > 0) {
    CollectRows(state);
    std::fill(multiplier_.begin(), multiplier_.end(), 0);
  }
  if (slides_.possible()) {
    KickAll(state);
    slides_.Collect(state, {kicked_m_s_, groups_}, dt_s);
    if (!slides_.empty()) MeetSlides(state);
  }
  if (rows_ > 0) {
    MeetConstraints(state, dt_s, parallel, report);
  } else {
    MoveAll(state, dt_s, parallel);
  }
  FinishMove(state);
  for (int p : slides_.particles()) load_n_[p].setZero();
  for (int p : state.contacts.zone_members) {
    const Vec3 change = model_.mass_kg[p] * (moved_velocity_m_s_[p] - state.velocity_m_s[p]);
    load_n_[p] = force_n[p] + (InnerImpulse(p) - change) / dt_s;
  }
  if (!model_.carried.empty()) ShareLoads(state.contacts);
}

void SubspaceSolver::ProjectGroups(const State& state) {
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    groups_[z].Project(Members(state.contacts, static_cast<int>(z)), state.position_m,
                       model_.mass_kg, free_m_s_);
  }
}

// Velocities from the free ones, the multipliers and the groups' twists.
void SubspaceSolver::KickAll(const State& state) {
  for (const Part& part : parts_) {
    const double multiplier = part.row < 0 ? 0 : multiplier_[part.row];
    const double *free = Flat(free_m_s_), *response = Flat(response_);
    double* kicked = Flat(kicked_m_s_);
    for (int i = 3 * part.first; i < 3 * (part.first + part.count); ++i) {
      kicked[i] = part.row < 0 ? free[i] : free[i] + multiplier * response[i];
    }
  }
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    for (int p : Members(state.contacts, static_cast<int>(z))) {
      kicked_m_s_[p] = model_.fixed[p] ? Vec3::Zero() : groups_[z].VelocityAt(state.position_m[p]);
    }
  }
  Carry(model_, kicked_m_s_);
}

// Positions after the move.
void SubspaceSolver::MoveAll(const State& state, double dt_s, Parallel* parallel) {
  parallel->VectorFor(static_cast<int>(parts_.size()), part_grain_, [&](int begin, int end) {
    const double *x = Flat(state.position_m), *free = Flat(free_m_s_), *response = Flat(response_);
    double* moved = Flat(moved_m_);
    for (int k = begin; k < end; ++k) {
      const Part& part = parts_[k];
      const double multiplier = part.row < 0 ? 0 : multiplier_[part.row];
      for (int i = 3 * part.first; i < 3 * (part.first + part.count); ++i) {
        moved[i] = x[i] + dt_s * (part.row < 0 ? free[i] : free[i] + multiplier * response[i]);
      }
    }
  });
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    groups_[z].Move(dt_s);
    for (int p : Members(state.contacts, static_cast<int>(z))) {
      if (!model_.fixed[p]) moved_m_[p] = groups_[z].MovedPosition(state.position_m[p]);
    }
  }
  Carry(model_, moved_m_);
}

// Velocities before and after the move that MoveAll() made.
void SubspaceSolver::FinishMove(const State& state) {
  KickAll(state);
  moved_velocity_m_s_ = kicked_m_s_;
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    for (int p : Members(state.contacts, static_cast<int>(z))) {
      if (!model_.fixed[p]) moved_velocity_m_s_[p] = groups_[z].MovedVelocity(moved_m_[p]);
    }
  }
  Carry(model_, moved_velocity_m_s_);
}

// What carries particles of a zone carries their load: each gets the part that its area has in it.
void SubspaceSolver::ShareLoads(const Contacts& contacts) {
  for (int p : contacts.zone_members) carried_area_m2_[p] = 0;
  const auto for_each = [&](const auto& visit) {
    for (const CarriedParticle& c : model_.carried) {
      if (contacts.zone_of[c.particle] < 0) continue;
      for (int k = 0; k < 4; ++k) {
        visit(c, c.carriers[k], std::max(c.weights[k], 0.0) * model_.area_m2[c.particle]);
      }
    }
  };
  for_each([&](const CarriedParticle&, int carrier, double area_m2) {
    carried_area_m2_[carrier] += area_m2;
  });
  for_each([&](const CarriedParticle& c, int carrier, double area_m2) {
    if (area_m2 > 0) load_n_[c.particle] += area_m2 / carried_area_m2_[carrier] * load_n_[carrier];
  });
}

void SubspaceSolver::CollectRows(const State& state) {
  for (const Effect* effect : constraints_)
    effect->ConstraintGradients(state.position_m, gradient_);
  GiveToCarriers(model_, gradient_);
  for (int r = 0; r < rows_; ++r) {
    double free = 0, all = 0;
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
void SubspaceSolver::StopConstraints() {
  for (int r = 0; r < rows_; ++r) {
    residual_[r] = 0;
    for (int p = row_[r].first; p < row_[r].first + row_[r].count; ++p) {
      residual_[r] -= gradient_[p].dot(kicked_m_s_[p]);
    }
  }
  SolveRows(residual_, change_);
  AddMultipliers(change_);
}

void SubspaceSolver::MeetSlides(const State& state) {
  for (int pass = 0; pass < kSlidePasses; ++pass) {
    KickAll(state);
    if (rows_ > 0) {
      StopConstraints();
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
double SubspaceSolver::MeasureRows(double dt_s) {
  int first = 0;
  for (const Effect* effect : constraints_) {
    const std::size_t count = effect->constraints().size();
    effect->ConstraintResiduals(moved_m_, std::span(residual_).subspan(first, count));
    first += static_cast<int>(count);
  }
  double worst = 0;
  for (int r = 0; r < rows_; ++r) {
    const double error = std::abs(residual_[r]) / row_[r].scale;
    if (preconditioner_[r] > 0 && !(error <= worst)) worst = error;
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
    const double worst = MeasureRows(dt_s);
    if (worst < least) {
      least = worst;
      best_ = multiplier_;
    }
    if (worst <= kConstraintTolerance) return;
    // At the floor of round-off the error stops shrinking.
    if (iteration == kConstraintIterations || !(worst < kDiverged)) {
      if (!(least < kNearlyMet)) report->bits |= kStepVolumeNotMet;
      if (worst == least) return;
      for (int r = 0; r < rows_; ++r) change_[r] = best_[r] - multiplier_[r];
      AddMultipliers(change_);
      MoveAll(state, dt_s, parallel);
      return;
    }
    Extrapolate(iteration);
    SolveRows(residual_, change_);
    AddMultipliers(change_);
  }
}

void SubspaceSolver::CorrectPositions(std::span<Vec3> position_m) {
  for (int iteration = 0; iteration < kConstraintIterations && rows_ > 0; ++iteration) {
    int first = 0;
    for (const Effect* effect : constraints_) {
      effect->ConstraintGradients(position_m, gradient_);
      GiveToCarriers(model_, gradient_);
      const std::size_t count = effect->constraints().size();
      effect->ConstraintResiduals(position_m, std::span(residual_).subspan(first, count));
      first += static_cast<int>(count);
    }
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

void SubspaceSolver::Accept(State* state, double dt_s) {
  slid_ = {};
  if (!slides_.empty()) {
    slid_ = slides_.Judge(*state, {kicked_m_s_, groups_}, dt_s);
    for (int p : slides_.particles()) load_n_[p] -= slides_.ImpulseOn(p) / dt_s;
  }
  state->position_m.swap(moved_m_);
  state->velocity_m_s.swap(moved_velocity_m_s_);
  StoreMomenta(state);
}

void SubspaceSolver::StoreMomenta(State* state) const {
  for (Zone& zone : state->contacts.zones) {
    const std::span<const std::int32_t> members =
        std::span(state->contacts.zone_members).subspan(zone.first, zone.count);
    double mass = 0;
    zone.centre_m.setZero();
    zone.momentum_kg_m_s.setZero();
    zone.angular_momentum_kg_m2_s.setZero();
    for (int p : members) {
      mass += model_.mass_kg[p];
      zone.centre_m += model_.mass_kg[p] * state->position_m[p];
      zone.momentum_kg_m_s += model_.mass_kg[p] * state->velocity_m_s[p];
    }
    zone.centre_m /= mass;
    for (int p : members) {
      zone.angular_momentum_kg_m2_s +=
          (state->position_m[p] - zone.centre_m).cross(model_.mass_kg[p] * state->velocity_m_s[p]);
    }
  }
}

}  // namespace adhesim
