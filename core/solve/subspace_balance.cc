// The part of the system that is about what moves as a whole: groups of bodies that zones join.

#include <Eigen/LU>
#include <algorithm>

#include "core/solve/subspace_system.h"

namespace adhesim {
namespace {

constexpr double kRank = 1e-6;  // of inertias: what lies on a line has no turn about it to speak of

}  // namespace

void SubspaceSystem::FindLoose(const State& state, std::span<const RigidGroup> groups) {
  for (int p = 0; p < model_.particle_count(); ++p) {
    const int zone = state.contacts.zone_of[p];
    loose_[p] = active_[p] && (zone < 0 || groups[zone].freedom == RigidGroup::Freedom::kFree);
  }
  joined_.Reset();
  for (const Zone& zone : contacts_zones_) {
    const auto members = members_.subspan(zone.first, zone.count);
    // The first may be carried, and then is not loose whatever its zone is.
    const auto first =
        std::find_if(members.begin(), members.end(), [&](int p) { return loose_[p]; });
    if (first == members.end()) continue;
    for (int p : members) joined_.Unite(model_.body_of[*first], model_.body_of[p]);
  }
  for (std::size_t b = 0; b < component_.size(); ++b)
    component_[b] = joined_.Root(static_cast<int>(b));
  for (Turn& turn : turns_) turn.free = true;
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (!loose_[p] && model_.mass_kg[p] > 0) {
      turns_[component_[model_.body_of[p]]].free = false;
    }
  }
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

// w = I^-1 Z^T r is what is missing where nothing strains; where the turn strains what it turns,
// the part of it that brings r.A^-1 r down most.
void SubspaceSystem::BalanceTurns(std::span<Padded> x, std::span<Padded> r, Parallel* parallel) {
  for (Turn& turn : turns_) turn.mass_kg = 0;
  const auto for_each = [&](const auto& visit) {
    for (int p = 0; p < model_.particle_count(); ++p) {
      Turn& turn = turns_[component_[model_.body_of[p]]];
      if (loose_[p] && turn.free) visit(p, turn);
    }
  };
  for_each([&](int p, Turn& turn) {
    if (turn.mass_kg == 0) turn = {true, 0, position_m_[p]};  // far from the world's origin, too
    turn.mass_kg += model_.mass_kg[p];
    turn.centre_m += model_.mass_kg[p] * (position_m_[p] - turn.origin_m);
  });
  for (Turn& turn : turns_) {
    if (turn.mass_kg > 0) turn.centre_m = turn.origin_m + turn.centre_m / turn.mass_kg;
  }
  for_each([&](int p, Turn& turn) {
    const Vec3 arm = position_m_[p] - turn.centre_m;
    turn.spread += model_.mass_kg[p] * arm * arm.transpose();
    turn.rate += arm.cross(r[p].vec());
  });
  bool any = false;
  for (Turn& turn : turns_) {
    if (!(turn.mass_kg > 0)) continue;
    const Mat3 inertia = turn.spread.trace() * Mat3::Identity() - turn.spread;
    const double size = inertia.trace() / 3;
    const bool turns = inertia.determinant() > kRank * size * size * size;
    turn.rate = turns ? Vec3(inertia.inverse() * turn.rate) : Vec3::Zero();
    any = any || turns;
  }
  if (!any) return;
  std::fill(p_.begin(), p_.end(), Padded{});
  for_each(
      [&](int p, const Turn& turn) { p_[p].Set(turn.rate.cross(position_m_[p] - turn.centre_m)); });
  Multiply(p_, ap_, parallel);
  for_each([&](int p, Turn& turn) {
    turn.descent += p_[p].vec().dot(r[p].vec());
    turn.curvature += p_[p].vec().dot(ap_[p].vec());
  });
  for_each([&](int p, const Turn& turn) {
    if (!(turn.curvature > 0)) return;
    const double part = turn.descent / turn.curvature;
    x[p].Set(x[p].vec() + part * p_[p].vec());
    r[p].Set(r[p].vec() - part * ap_[p].vec());
  });
}

}  // namespace adhesim
