// The part of the adhesive that is about letting go.

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/contact/adhesive.h"
#include "core/contact/zone_builder.h"
#include "core/model/chance.h"

namespace adhesim {

// From the triangle (or tool) to the particle's (or tissue's) side.
Vec3 Adhesive::BondNormal(const Bond& bond, const State& state) const {
  if (bond.tool >= 0) return state.tools[bond.tool].pose.orientation * bond.tool_normal;
  return GeometryOf(bond, model_, state.position_m).normal;
}

void Adhesive::Bear(int tool, const BondLimit& one, double scale, Limit* limit) const {
  const std::optional<double>& friction =
      tool < 0 ? model_.adhesive->friction_coefficient : model_.tools[tool].friction_coefficient;
  limit->may_slide = limit->may_slide && friction;
  limit->friction = std::max(limit->friction, friction.value_or(0));
  // What has several bonds is held by its strongest.
  limit->normal_n = std::max(limit->normal_n, scale * one.normal_n);
  limit->shear_n = std::max(limit->shear_n, scale * one.shear_n);
}

void Adhesive::Limits(int particle, const Bond& bond, const Vec3& normal, double scale) {
  Limit& limit = limit_[particle];
  if (!limit.bonded) limit = {Vec3::Zero(), 0, 0, true, true, false, false};
  limit.normal_sum += normal;
  Bear(bond.tool, LimitOf(bond, particle, model_, crack_area_m2_[particle]), scale, &limit);
}

void Adhesive::CollectLimits(const State& state, std::span<const double> strength_scale,
                             const Contacts& contacts) {
  for (int p : contacts.zone_members) {
    limit_[p].bonded = false;
    crack_area_m2_[p] = model_.area_m2[p];
  }
  if (!patches_.empty()) CollectPatches(contacts);
  for (const Bond& bond : contacts.bonds) {
    if (bond.sliding || bond.tied || Sleeps(bond)) continue;
    const Vec3 normal = BondNormal(bond, state);
    const double scale = bond.tool >= 0 ? strength_scale[bond.tool] : 1;
    // Both ends of an edge share its normal as the corners share theirs.
    if (bond.particle >= 0 && bond.holds_particle)
      Limits(bond.particle, bond, (1 - bond.partner_weight) * normal, scale);
    if (bond.partner >= 0 && bond.holds_partner)
      Limits(bond.partner, bond, bond.partner_weight * normal, scale);
    // A tool's normal already points to the tissue; a triangle's corners are on the other side of
    // theirs.
    const Vec3 corner_normal = bond.tool >= 0 ? normal : Vec3(-normal);
    for (int k = 0; k < 3; ++k) {
      if (bond.vertices[k] >= 0)
        Limits(bond.vertices[k], bond, bond.weights[k] * corner_normal, scale);
    }
  }
}

Adhesive::Demand Adhesive::DemandOn(const Limit& limit, const Vec3& load) const {
  const double length = limit.normal_sum.norm();
  if (!(length > 0)) return {0, false, false};
  const Vec3 normal = limit.normal_sum / length;
  const double tension = load.dot(normal);
  const double shear = (load - tension * normal).norm();
  const auto over = [](double force, double strength) {
    if (force == 0) return 0.0;
    return strength > 0 ? force / strength : std::numeric_limits<double>::infinity();
  };
  if (tension <= 0) {
    if (!limit.may_slide) return {0, false, false};
    return {over(shear, limit.shear_n - tension * limit.friction), true, false};
  }
  const double normal_ratio = over(tension, limit.normal_n);
  const double shear_ratio = over(shear, limit.shear_n);
  return {std::sqrt(normal_ratio * normal_ratio + shear_ratio * shear_ratio), false, true};
}

bool Adhesive::TakenByChance(int who, const Demand& demand, const Vec3& load, double chance_s,
                             const Contacts& contacts) const {
  const std::optional<BellRelease>& bell = model_.adhesive->bell;
  if (!bell || !demand.pulled || !(chance_s > 0)) return false;
  const double rate_per_s = bell->rate_per_s * Exp(load.norm() / bell->force_n);
  return Chance(model_.seed, contacts.draws, who) >= Exp(-rate_per_s * chance_s);
}

int Adhesive::ReleaseParticles(std::span<const Vec3> load_n, double chance_s,
                               const Contacts& contacts, Zone* zone) {
  int released = 0;
  for (int k = zone->first; k < zone->first + zone->count; ++k) {
    const int p = contacts.zone_members[k];
    if (!limit_[p].bonded || model_.fixed[p] || !rigid_.DecidesByItself(p)) continue;
    const Demand demand = DemandOn(limit_[p], load_n[p]);
    zone->load = std::max(zone->load, demand.ratio);
    if (demand.ratio > 1 || TakenByChance(p, demand, load_n[p], chance_s, contacts)) {
      (demand.slides ? limit_[p].slides : limit_[p].released) = true;
      ++released;
    }
  }
  return released;
}

// The members of patches, body by body and patch by patch, and the area of each.
void Adhesive::CollectPatches(const Contacts& contacts) {
  patches_.Mark(contacts);
  patch_members_.clear();
  for (const Zone& zone : contacts.zones) {
    if (!LetsGoInPatches(zone)) continue;
    const auto first = contacts.zone_members.begin() + zone.first;
    patch_members_.insert(patch_members_.end(), first, first + zone.count);
  }
  const auto key = [&](int p) {
    return std::tuple(contacts.zone_of[p], model_.body_of[p], patches_.CubeOf(p));
  };
  std::sort(patch_members_.begin(), patch_members_.end(), [&](int a, int b) {
    const auto ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  patch_list_.clear();
  for (int k = 0; k < static_cast<int>(patch_members_.size()); ++k) {
    const int p = patch_members_[k];
    if (k == 0 || key(p) != key(patch_members_[k - 1])) patch_list_.push_back({k, 0, 0});
    ++patch_list_.back().count;
    patch_list_.back().area_m2 += model_.area_m2[p];
  }
  for (const Patch& patch : patch_list_) {
    for (int k = patch.first; k < patch.first + patch.count; ++k)
      crack_area_m2_[patch_members_[k]] = patch.area_m2;
  }
}

int Adhesive::ReleasePatches(std::span<const Vec3> load_n, double chance_s, Contacts* contacts) {
  int released = 0;
  for (const Patch& patch : patch_list_) {
    const auto members = std::span(patch_members_).subspan(patch.first, patch.count);
    Limit whole{Vec3::Zero(), 0, 0, true, true, false, false};
    Vec3 load = Vec3::Zero();
    bool fixed = false;
    for (int p : members) {
      if (!limit_[p].bonded) continue;
      fixed = fixed || model_.fixed[p];
      whole.normal_sum += limit_[p].normal_sum;
      whole.normal_n += limit_[p].normal_n;
      whole.shear_n += limit_[p].shear_n;
      whole.may_slide = whole.may_slide && limit_[p].may_slide;
      whole.friction = std::max(whole.friction, limit_[p].friction);
      load += load_n[p];
    }
    if (fixed) continue;  // its load is not of the contact alone; the other side decides
    const Demand demand = DemandOn(whole, load);
    Zone& zone = contacts->zones[contacts->zone_of[members[0]]];
    zone.load = std::max(zone.load, demand.ratio);
    if (demand.ratio <= 1 && !TakenByChance(members[0], demand, load, chance_s, *contacts))
      continue;
    for (int p : members) {
      if (limit_[p].bonded) (demand.slides ? limit_[p].slides : limit_[p].released) = true;
    }
    ++released;
  }
  return released;
}

int Adhesive::Release(std::span<const Vec3> load_n, std::span<const TieLoad> tie_load,
                      const State& state, std::span<const double> strength_scale, double chance_s,
                      Contacts* contacts) {
  if (contacts->bonds.empty()) return 0;
  contacts->draws += model_.adhesive->bell && chance_s > 0;
  CollectLimits(state, strength_scale, *contacts);
  bond_verdict_.assign(contacts->bonds.size(), 0);
  int released = ReleaseTies(tie_load, state, chance_s, *contacts);
  for (Zone& zone : contacts->zones) {
    if (zone.asleep) continue;
    zone.load = 0;
    if (!LetsGoInPatches(zone)) released += ReleaseParticles(load_n, chance_s, *contacts, &zone);
  }
  if (!patches_.empty()) released += ReleasePatches(load_n, chance_s, contacts);
  released += rigid_.Release(
      *contacts, load_n, [&](const Bond& bond) { return BondNormal(bond, state); },
      [&](const RigidInterfaces::Cut& cut) {
        Limit limit{cut.normal_sum, 0, 0, true, true, false, false};
        Bear(cut.tool, LimitOf(cut.tool, cut.sticky, cut.area_m2, cut.mass_kg, model_),
             cut.strength_scale * (cut.tool >= 0 ? strength_scale[cut.tool] : 1), &limit);
        const Demand demand = DemandOn(limit, cut.load_n);
        contacts->zones[cut.zone].load = std::max(contacts->zones[cut.zone].load, demand.ratio);
        const int first = contacts->zone_members[contacts->zones[cut.zone].first];
        const int who = model_.particle_count() * (1 + cut.node) + first;
        if (TakenByChance(who, demand, cut.load_n, chance_s, *contacts)) return kLetsGo;
        return demand.ratio <= 1 ? kHolds : demand.slides ? kSlides : kLetsGo;
      },
      &bond_verdict_);
  if (released > 0) RemoveReleased(contacts);
  return released;
}

void Adhesive::RemoveReleased(Contacts* contacts) {
  for (std::size_t b = 0; b < contacts->bonds.size(); ++b) {
    Bond& bond = contacts->bonds[b];
    if (bond.sliding || Sleeps(bond)) continue;
    const int body = model_.body_of[model_.triangles[bond.triangle][0]];
    if (bond.tied) {
      if (bond_verdict_[b] != kLetsGo) continue;
      // What only kept surfaces apart may stick at once.
      if (bond.calm != ZoneBuilder::kAcrossPatches)
        AddReleased(bond.particle, body, bond.gap_m, contacts);
      bond.holds_particle = bond.holds_partner = false;
      continue;
    }
    const int other = bond.tool >= 0 ? ToolKey(bond.tool) : model_.body_of[bond.particle];
    const auto lets_go = [&](int p) { return bond_verdict_[b] == kLetsGo || limit_[p].released; };
    bool slides = bond_verdict_[b] == kSlides;
    bond.ForEachMember([&](int p) { slides = slides || limit_[p].slides; });
    for (std::int32_t& v : bond.vertices) {
      if (v < 0 || !lets_go(v)) continue;
      AddReleased(v, other, bond.gap_m, contacts);
      v = -1;
    }
    if (bond.tool >= 0) {
      if (slides && bond.Holds()) {
        bond.sliding = true;
        bond.calm = 0;
      }
      continue;
    }
    if (bond.holds_particle && lets_go(bond.particle)) {
      AddReleased(bond.particle, body, bond.gap_m, contacts);
      bond.holds_particle = false;
    }
    if (bond.holds_partner && lets_go(bond.partner)) {
      AddReleased(bond.partner, body, bond.gap_m, contacts);
      bond.holds_partner = false;
    }
    // What the other side has left behind.
    if (bond.holds_particle && !bond.Holds()) {
      AddReleased(bond.particle, body, bond.gap_m, contacts);
    } else if (slides && bond.Holds()) {
      bond.sliding = true;
      bond.strength_scale = 1;
      bond.calm = 0;
      ShowMembers(&bond);
    }
  }
  std::erase_if(contacts->bonds, [&](const Bond& bond) { return !bond.Holds(); });
}

int Adhesive::DropApart(std::span<const Vec3> position_m, Contacts* contacts) const {
  const bool patches = model_.adhesive->patch_size_m.has_value();
  // Where zones neither begin after a move nor are taken apart by corrections.
  const bool keeps_gaps = !slides() && !contacts->overlapping;
  return static_cast<int>(std::erase_if(contacts->bonds, [&](const Bond& bond) {
    if (bond.tool >= 0 || bond.sliding || Sleeps(bond)) return false;
    // Where all that matters moves as one, so does the gap: all that has any weight, or members.
    if (keeps_gaps && MoveAsOne(*contacts, bond.triangle, Vec3(bond.weights.data()), bond.particle,
                                bond.partner >= 0 ? bond.partner : bond.particle)) {
      return false;
    }
    bool whole = !patches && (bond.holds_particle || 1 - bond.partner_weight <= kMinWeight) &&
                 (bond.partner < 0 || bond.holds_partner || bond.partner_weight <= kMinWeight);
    for (int k = 0; k < 3; ++k)
      whole = whole && (bond.vertices[k] >= 0 || bond.weights[k] <= kMinWeight);
    return !whole && std::abs(GeometryOf(bond, model_, position_m).gap_m) > release_distance_m_;
  }));
}

int Adhesive::ReleaseTool(int tool, Contacts* contacts) {
  return static_cast<int>(
      std::erase_if(contacts->bonds, [&](const Bond& bond) { return bond.tool == tool; }));
}

}  // namespace adhesim
