// The part of the system that is about what moves as a whole: groups of bodies that zones join.

#include <Eigen/LU>
#include <algorithm>

#include "core/solve/subspace_system.h"

namespace adhesim {
namespace {

// Of u.A u: with less than this beside translations there is no motion but round-off.
constexpr double kNoMotion = 1e-12;

}  // namespace

void SubspaceSystem::FindLoose(const State& state, std::span<const RigidGroup> groups) {
  for (int p = 0; p < model_.particle_count(); ++p) {
    const int zone = state.contacts.zone_of[p];
    loose_[p] = active_[p] && (zone < 0 || groups[zone].freedom == RigidGroup::Freedom::kFree);
  }
  joined_.Reset();
  for (const Zone& zone : contacts_zones_) {
    const auto members = members_.subspan(zone.first, zone.count);
    // The first may be carried, and then does not move by itself whatever its zone is.
    const auto first =
        std::find_if(members.begin(), members.end(), [&](int p) { return active_[p]; });
    if (first == members.end()) continue;
    for (int p : members) {
      if (!model_.fixed[p]) joined_.Unite(model_.body_of[*first], model_.body_of[p]);
    }
  }
  for (std::size_t b = 0; b < component_.size(); ++b)
    component_[b] = joined_.Root(static_cast<int>(b));
  FindHolds(groups);
  // Rows of stiffness sum to zero: a row of A Z is the mass, less what is not loose.
  std::fill(stiffness_sum_.begin(), stiffness_sum_.end(), Mat3::Zero());
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (loose_[p]) {
      stiffness_sum_[component_[model_.body_of[p]]] += model_.mass_kg[p] * Mat3::Identity();
      continue;
    }
    for (int k = matrix_.row_start()[p]; k < matrix_.row_start()[p + 1]; ++k) {
      const int q = matrix_.column()[k];
      if (loose_[q]) stiffness_sum_[component_[model_.body_of[q]]] -= matrix_.At(k);
    }
  }
}

void SubspaceSystem::Balance(std::span<Padded> x, std::span<Padded> r) const {
  std::fill(balance_.begin(), balance_.end(), Vec3::Zero());
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (loose_[p]) balance_[component_[model_.body_of[p]]] += r[p].vec();
  }
  for (std::size_t body = 0; body < balance_.size(); ++body) {
    if (component_[body] != static_cast<int>(body)) continue;
    const Mat3& sum = stiffness_sum_[body];
    balance_[body] = sum.trace() > 0
                         ? Vec3((0.5 * (sum + sum.transpose())).inverse() * balance_[body])
                         : Vec3::Zero();
  }
  const auto of = [&](int p) -> const Vec3& { return balance_[component_[model_.body_of[p]]]; };
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (loose_[p]) {
      x[p].Set(x[p].vec() + of(p));
      r[p].Set(r[p].vec() - model_.mass_kg[p] * of(p));
      continue;
    }
    for (int k = matrix_.row_start()[p]; k < matrix_.row_start()[p + 1]; ++k) {
      const int q = matrix_.column()[k];
      if (!loose_[q]) continue;
      r[q].Set(r[q].vec() + matrix_.At(k).transpose() * of(q));
      if (active_[p]) r[p].Set(r[p].vec() - matrix_.At(k) * of(q));
    }
  }
}

// What of each component is held: its particles that cannot move, and pins that its zones turn
// about.
void SubspaceSystem::FindHolds(std::span<const RigidGroup> groups) {
  for (Whole& whole : wholes_) whole.hold = {};
  for (int p = 0; p < model_.particle_count(); ++p) {
    Hold& hold = WholeOf(p).hold;
    if (!active_[p] && model_.mass_kg[p] > 0 && !hold.locked()) hold.Add(position_m_[p]);
  }
  for (const ZoneInverse& zone : zones_) {
    if (groups[zone.zone].freedom == RigidGroup::Freedom::kFree) continue;
    const auto members =
        members_.subspan(contacts_zones_[zone.zone].first, contacts_zones_[zone.zone].count);
    for (int p : members) {
      if (!active_[p]) continue;
      for (int pin : members) {
        if (model_.fixed[pin]) WholeOf(p).hold.Add(position_m_[pin]);
      }
      break;
    }
  }
}

// First turns, then u itself. What is free as a whole has nothing left to be pushed along.
void SubspaceSystem::BalanceWork(std::span<Padded> u, std::span<Padded> au, std::span<Padded> x,
                                 std::span<Padded> r, Parallel* parallel) {
  if (MeasureTurns(r)) AddTurns(u, au, x, r, parallel);
  MeasureWork(u, au, r);
  for (std::size_t body = 0; body < wholes_.size(); ++body) {
    if (component_[body] == static_cast<int>(body)) FindPart(stiffness_sum_[body], &wholes_[body]);
  }
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (!active_[p]) continue;
    const double part = WholeOf(p).part;
    x[p].Set(x[p].vec() + part * u[p].vec());
    r[p].Set(r[p].vec() - part * au[p].vec());
  }
  Balance(x, r);
}

void SubspaceSystem::MeasureWork(std::span<const Padded> u, std::span<const Padded> au,
                                 std::span<const Padded> r) {
  for (Whole& whole : wholes_) {
    whole.work = whole.curvature = 0;
    whole.residual.setZero();
    whole.product.setZero();
  }
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (!active_[p]) continue;
    Whole& whole = WholeOf(p);
    const Vec3 motion = u[p].vec(), product = au[p].vec(), left = r[p].vec();
    whole.work += motion.dot(left);
    whole.curvature += motion.dot(product);
    if (!loose_[p]) continue;
    whole.residual += left;
    whole.product += product;
  }
}

template <typename Visit>
void SubspaceSystem::ForEachTurning(const Visit& visit) {
  for (int p = 0; p < model_.particle_count(); ++p) {
    Whole& whole = WholeOf(p);
    if (active_[p] && !whole.hold.locked()) visit(p, whole);
  }
}

// False: nothing turns.
bool SubspaceSystem::MeasureTurns(std::span<const Padded> r) {
  const auto turns = [](const Whole& whole) { return !whole.hold.locked(); };
  if (std::none_of(wholes_.begin(), wholes_.end(), turns)) return false;
  for (Whole& whole : wholes_) {
    whole.mass_kg = 0;
    whole.turn.setZero();
    whole.spread.setZero();
  }
  // About the first, for what is far from the world's origin.
  ForEachTurning([&](int p, Whole& whole) {
    if (whole.mass_kg == 0) whole.origin_m = whole.centre_m = position_m_[p];
    whole.mass_kg += model_.mass_kg[p];
    whole.centre_m += model_.mass_kg[p] * (position_m_[p] - whole.origin_m);
  });
  for (Whole& whole : wholes_) {
    if (!(whole.mass_kg > 0)) continue;
    whole.centre_m = whole.hold.free()
                         ? Vec3(whole.origin_m + (whole.centre_m - whole.origin_m) / whole.mass_kg)
                         : whole.hold.point_m;
  }
  ForEachTurning([&](int p, Whole& whole) {
    const Vec3 arm = position_m_[p] - whole.centre_m;
    whole.spread += model_.mass_kg[p] * arm * arm.transpose();
    whole.turn += arm.cross(r[p].vec());
  });
  for (Whole& whole : wholes_) whole.turn = whole.hold.InverseInertia(whole.spread) * whole.turn;
  return true;
}

// The part of u that brings r.A^-1 r down most, all translations of what is loose beside it.
void SubspaceSystem::FindPart(const Mat3& stiffness_sum, Whole* whole) {
  whole->part = 0;
  if (whole->hold.free()) return;
  Vec3 drift = Vec3::Zero();
  if (stiffness_sum.trace() > 0) {
    drift = (0.5 * (stiffness_sum + stiffness_sum.transpose())).inverse() * whole->product;
  }
  const double curvature = whole->curvature - whole->product.dot(drift);
  if (!(curvature > kNoMotion * whole->curvature)) return;
  whole->part = (whole->work - whole->residual.dot(drift)) / curvature;
}

// The turn that the torque asks for, and of it as much as brings r.A^-1 r down most.
void SubspaceSystem::AddTurns(std::span<Padded> u, std::span<Padded> au, std::span<Padded> x,
                              std::span<Padded> r, Parallel* parallel) {
  std::fill(p_.begin(), p_.end(), Padded{});
  ForEachTurning([&](int p, const Whole& whole) {
    p_[p].Set(whole.turn.cross(position_m_[p] - whole.centre_m));
  });
  Multiply(p_, ap_, parallel);
  for (Whole& whole : wholes_) whole.work = whole.curvature = 0;
  ForEachTurning([&](int p, Whole& whole) {
    whole.work += p_[p].vec().dot(r[p].vec());
    whole.curvature += p_[p].vec().dot(ap_[p].vec());
  });
  ForEachTurning([&](int p, const Whole& whole) {
    if (!(whole.curvature > 0)) return;
    const double part = whole.work / whole.curvature;
    x[p].Set(x[p].vec() + part * p_[p].vec());
    u[p].Set(u[p].vec() + part * p_[p].vec());
    r[p].Set(r[p].vec() - part * ap_[p].vec());
    au[p].Set(au[p].vec() + part * ap_[p].vec());
  });
}

}  // namespace adhesim
