#include "core/solve/subspace_solver.h"

#include <algorithm>
#include <cmath>

#include "core/model/awake.h"
#include "core/model/carried.h"
#include "core/solve/ledger.h"

namespace adhesim {
namespace {

constexpr int kGrain = 4096;         // particles: about 20 us of work
constexpr int kPartParticles = 512;  // at most, of one part

// An array of vectors as the numbers it holds, for loops that treat all three alike.
double* Flat(std::vector<Vec3>& vectors) { return vectors.empty() ? nullptr : vectors[0].data(); }
const double* Flat(std::span<const Vec3> vectors) {
  return vectors.empty() ? nullptr : vectors[0].data();
}

}  // namespace

SubspaceSolver::SubspaceSolver(const Model& model, std::vector<const Effect*> constraints)
    : model_(model), constraints_(std::move(constraints)), slides_(model), ties_(model) {
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
  if (rows_ > 0) on_zone_.reserve(n);
  for (auto* array : {&multiplier_, &lacking_, &diagonal_, &movable_, &preconditioner_, &residual_,
                      &left_, &best_}) {
    array->assign(rows_, 0);
  }
  for (auto* array : {&change_, &cg_r_, &cg_p_, &cg_ap_, &cg_z_, &all_rhs_}) {
    array->assign(rows_ + 3 * ties_.capacity(), 0);
  }
  if (!ties_.possible()) return;
  tie_scratch_ns_.assign(n, Vec3::Zero());
  zone_wrench_.reserve(n);
}

void SubspaceSolver::MakeParts() {
  for (int p = 0; p < model_.particle_count(); ++p) {
    const int row = row_of_.empty() ? -1 : row_of_[p];
    const int body = model_.body_of[p];
    if (parts_.empty() || parts_.back().row != row || parts_.back().count == kPartParticles ||
        (model_.sleep && parts_.back().body != body)) {
      parts_.push_back({p, 0, row, body});
    }
    ++parts_.back().count;
  }
  part_grain_ = 1 + static_cast<int>(parts_.size() * std::size_t{kGrain} / (1 + per_kg_.size()));
}

void SubspaceSolver::FormGroups(const State& state, std::span<const Twist> tool_twist) {
  groups_.clear();
  for (int z = 0; z < static_cast<int>(state.contacts.zones.size()); ++z) {
    const int tool = state.contacts.zones[z].tool;
    if (state.contacts.zones[z].holds_sleepers) {
      groups_.emplace_back().freedom = RigidGroup::Freedom::kLocked;
      continue;
    }
    groups_.push_back(RigidGroup::Of(Members(state.contacts, z), state.position_m, model_.mass_kg,
                                     model_.fixed, tool >= 0 ? &state.tools[tool].pose : nullptr));
    // Fixed corners that hold it without being members: three of a triangle.
    if (const int pins = state.contacts.zones[z].pins; pins > 0) {
      const auto members = Members(state.contacts, z);
      const auto fixed = [&](int p) { return model_.fixed[p] != 0; };
      if (pins > std::count_if(members.begin(), members.end(), fixed))
        groups_.back().freedom = RigidGroup::Freedom::kLocked;
    }
    if (tool >= 0) groups_.back().twist = tool_twist[tool];
  }
}

void SubspaceSolver::Capture(State* state, std::span<Wrench> tool_impulse) {
  for (std::size_t t = 0; t < old_twist_.size(); ++t) old_twist_[t] = state->tools[t].twist;
  FormGroups(*state, old_twist_);
  for (const auto& [begin, end] : AwakeRanges(model_.particle_count(), state->sleep)) {
    for (int p = begin; p < end; ++p) {
      free_m_s_[p] = model_.fixed[p] ? Vec3::Zero() : state->velocity_m_s[p];
    }
  }
  ProjectGroups(*state);
  ties_.Collect(*state, groups_, per_kg_, 0);
  if (rows_ > 0) {
    // Sticking may have left a volume changing: the plastic impact ends that too.
    CollectRows(*state);
    std::fill(multiplier_.begin(), multiplier_.end(), 0);
  }
  if (rows_ > 0 || !ties_.empty()) {
    KickAll(*state);
    StopConstraints(*state);
  }
  KickAll(*state);
  BookCapture(model_, *this, state, tool_impulse);
  state->velocity_m_s = kicked_m_s_;
  StoreMomenta(state, true);
}

void SubspaceSolver::Try(const State& state, std::span<const Vec3> force_n, double dt_s,
                         Parallel* parallel, StepReport* report,
                         std::span<const double> multipliers, bool slides_met) {
  parallel->VectorFor(static_cast<int>(parts_.size()), part_grain_, [&](int begin, int end) {
    const double *v = Flat(state.velocity_m_s), *f = Flat(force_n), *per_kg = Flat(per_kg_);
    double* free = Flat(free_m_s_);
    for (int k = begin; k < end; ++k) {
      const Part& part = parts_[k];
      if (state.sleep.Of(part.body)) continue;
      const int last = 3 * (part.first + part.count);
      for (int i = 3 * part.first; i < last; ++i) free[i] = v[i] + (dt_s * per_kg[i]) * f[i];
    }
  });
  ProjectGroups(state);
  if (rows_ > 0) {
    CollectRows(state);
    std::fill(multiplier_.begin(), multiplier_.end(), 0);
    if (!multipliers.empty()) AddMultipliers(multipliers);
  }
  ties_.Collect(state, groups_, per_kg_, dt_s);
  if (!ties_.empty()) StartTies(state);
  if (slides_met) {
    GiveSlides(state);
  } else if (slides_.possible()) {
    KickAll(state);
    slides_.Collect(state, {kicked_m_s_, groups_}, tools_, dt_s);
    if (!slides_.empty()) MeetSlides(state);
  }
  if (rows_ > 0) {
    if (!ties_.empty()) {  // volumes may need no iteration
      KickAll(state);
      StopConstraints(state);
    }
    MeetConstraints(state, dt_s, parallel, report);
  } else {
    if (!ties_.empty()) MeetAll(state, report);
    MoveAll(state, dt_s, parallel);
  }
  FinishMove(state);
  for (int p : slides_.particles()) load_n_[p].setZero();
  for (int p : slides_.carried()) load_n_[p].setZero();
  for (int p : ties_.particles()) load_n_[p].setZero();
  for (const Zone& zone : state.contacts.zones) {
    for (int p : Members(state.contacts, zone)) {
      if (zone.holds_sleepers && state.sleep.Of(model_.body_of[p])) continue;  // the last one stays
      const Vec3 change = model_.mass_kg[p] * (moved_velocity_m_s_[p] - state.velocity_m_s[p]);
      load_n_[p] = force_n[p] + (InnerImpulse(p) - change) / dt_s;
    }
  }
  if (!model_.carried.empty()) ShareLoads(state.contacts);
  ties_.AddLoads(state, dt_s, load_n_);
  tie_load_ = ties_.Loads(dt_s);
}

void SubspaceSolver::ProjectGroups(const State& state) {
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    if (state.contacts.zones[z].asleep) continue;
    groups_[z].Project(Members(state.contacts, static_cast<int>(z)), state.position_m,
                       model_.mass_kg, free_m_s_);
  }
}

// Velocities from the free ones, the multipliers and the groups' twists.
void SubspaceSolver::KickAll(const State& state) {
  for (const Part& part : parts_) {
    if (state.sleep.Of(part.body)) continue;
    const double multiplier = part.row < 0 ? 0 : multiplier_[part.row];
    const double *free = Flat(free_m_s_), *response = Flat(response_);
    double* kicked = Flat(kicked_m_s_);
    for (int i = 3 * part.first; i < 3 * (part.first + part.count); ++i) {
      kicked[i] = part.row < 0 ? free[i] : free[i] + multiplier * response[i];
    }
  }
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    if (state.contacts.zones[z].asleep) continue;
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
      if (state.sleep.Of(part.body)) continue;
      const double multiplier = part.row < 0 ? 0 : multiplier_[part.row];
      for (int i = 3 * part.first; i < 3 * (part.first + part.count); ++i) {
        moved[i] = x[i] + dt_s * (part.row < 0 ? free[i] : free[i] + multiplier * response[i]);
      }
    }
  });
  for (std::size_t z = 0; z < groups_.size(); ++z) {
    if (state.contacts.zones[z].asleep) continue;
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
    if (state.contacts.zones[z].asleep) continue;
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
        visit(c, c.carriers[k], std::abs(c.weights[k]) * model_.area_m2[c.particle]);
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

void SubspaceSolver::LeaveOut(const State& state) {
  gradients_known_ = false;
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    if (!state.sleep.Of(static_cast<int>(b))) continue;
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      moved_m_[p] = state.position_m[p];
      for (auto* array : {&free_m_s_, &kicked_m_s_, &moved_velocity_m_s_}) (*array)[p].setZero();
      load_n_[p] = state.sleep.load_n[p];
    }
  }
}

void SubspaceSolver::Accept(State* state, double dt_s) {
  slid_ = {};
  if (!slides_.empty()) {
    slid_ = slides_.Judge(*state, {kicked_m_s_, groups_}, dt_s);
    for (int p : slides_.particles()) load_n_[p] -= slides_.ImpulseOn(p) / dt_s;
    for (int p : slides_.carried()) load_n_[p] -= slides_.ImpulseBy(p) / dt_s;
  }
  gradients_known_ = false;
  ties_.Store(dt_s, &state->contacts);
  state->position_m.swap(moved_m_);
  state->velocity_m_s.swap(moved_velocity_m_s_);
  StoreMomenta(state, false);
}

void SubspaceSolver::StoreMomenta(State* state, bool sleepers) const {
  for (Zone& zone : state->contacts.zones) {
    if (zone.asleep && !sleepers) continue;
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
