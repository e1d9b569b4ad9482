#include "core/contact/adhesive.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/model/bond_geometry.h"
#include "core/model/chance.h"

namespace adhesim {
namespace {

// Slower than this fraction of d_on per step is round-off, not approach.
constexpr double kApproach = 1e-9;
// Less than this share of d_on is not closer: a zone keeps gaps, but for round-off.
constexpr double kCloser = 1e-6;

// The last is the triangle's edge of an edge-edge bond.
std::tuple<int, int, int, int, int> Key(const Bond& bond) {
  return {bond.particle, bond.partner, bond.tool, bond.triangle,
          bond.partner >= 0 ? OppositeCorner(bond.weights) : 0};
}

bool KeyLess(const Bond& a, const Bond& b) { return Key(a) < Key(b); }

bool PairLess(const ReleasedPair& a, const ReleasedPair& b) {
  return a.particle != b.particle ? a.particle < b.particle : a.other < b.other;
}

int ToolKey(int tool) { return -1 - tool; }

}  // namespace

Adhesive::Adhesive(const Model& model) : model_(model), rigid_(model) {
  if (model.adhesive) {
    capture_distance_m_ = model.adhesive->capture_distance_m;
    release_distance_m_ = model.adhesive->release_distance_m;
  }
  limit_.resize(model.rest_position_m.size());
  bond_verdict_.reserve(4 * model.rest_position_m.size() + 64);
  touched_.resize(model.rest_position_m.size() * model.tools.size());
  calm_.reserve(4 * model.rest_position_m.size() + 64);
  kept_.reserve(4 * model.rest_position_m.size() + 64);
  edge_near_.reserve(4 * (8 * model.rest_position_m.size() + 64));
}

bool Adhesive::Insert(const Bond& bond, Contacts* contacts, StepReport* report) {
  if (contacts->bonds.size() == contacts->bonds.capacity()) {
    report->bits |= kStepBondCapacity;
    return false;
  }
  contacts->bonds.insert(
      std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond, KeyLess), bond);
  return true;
}

bool Adhesive::Hold(Bond bond, Contacts* contacts, StepReport* report) {
  const auto at = std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond, KeyLess);
  if (at == contacts->bonds.end() || KeyLess(bond, *at)) return Insert(bond, contacts, report);
  if (at->sliding) {
    bond.calm = at->calm;
    *at = bond;
    return false;
  }
  for (int k = 0; k < 3; ++k) bond.vertices[k] = std::max(bond.vertices[k], at->vertices[k]);
  bond.holds_particle |= at->holds_particle;
  bond.holds_partner |= at->holds_partner;
  if (bond.vertices == at->vertices && bond.holds_particle == at->holds_particle &&
      bond.holds_partner == at->holds_partner) {
    return false;
  }
  *at = bond;
  return true;
}

const ReleasedPair* Adhesive::FindReleased(const Contacts& contacts, int particle,
                                           int other) const {
  const ReleasedPair key{particle, other, 0};
  const auto at =
      std::lower_bound(contacts.released.begin(), contacts.released.end(), key, PairLess);
  return at != contacts.released.end() && at->particle == particle && at->other == other ? &*at
                                                                                         : nullptr;
}

// Whether the particle let go of the other side and has not been pressed closer since.
bool Adhesive::LetGo(int particle, int other, double gap_m, const Contacts& contacts) const {
  const ReleasedPair* released = FindReleased(contacts, particle, other);
  return released && gap_m >= released->gap_m - kCloser * capture_distance_m_;
}

void Adhesive::AddReleased(int particle, int other, double gap_m, Contacts* contacts) {
  const ReleasedPair pair{particle, other, gap_m};
  const auto at =
      std::lower_bound(contacts->released.begin(), contacts->released.end(), pair, PairLess);
  if (at != contacts->released.end() && at->particle == particle && at->other == other) {
    at->gap_m = std::min(at->gap_m, gap_m);  // of all its bonds, whatever their order
  } else if (contacts->released.size() < contacts->released.capacity()) {
    contacts->released.insert(at, pair);
  }
}

// Keeps the released pairs that are still within d_off: by the particle itself or by an edge that
// it is an end of.
void Adhesive::DropReleased(std::span<const NearPair> near, std::span<const NearEdges> near_edges,
                            Contacts* contacts) {
  if (contacts->released.empty()) return;
  ListEdgeEnds(near_edges);
  // All lists ascend by (particle, body).
  kept_.clear();
  auto pair = near.begin();
  auto end = edge_near_.begin();
  for (const ReleasedPair& released : contacts->released) {
    if (released.other < 0) {
      kept_.push_back(released);
      continue;
    }
    const std::pair key(released.particle, released.other);
    while (pair != near.end() && std::pair(pair->particle, pair->body) < key) ++pair;
    while (end != edge_near_.end() && *end < key) ++end;
    const bool near_enough = pair != near.end() && pair->particle == released.particle &&
                             pair->body == released.other && pair->gap_m <= release_distance_m_;
    if (near_enough || (end != edge_near_.end() && *end == key)) kept_.push_back(released);
  }
  contacts->released.assign(kept_.begin(), kept_.end());
}

int Adhesive::Capture(std::span<const NearPair> near, std::span<const NearEdges> near_edges,
                      const State& state, double dt_s, Contacts* contacts, StepReport* report) {
  DropReleased(near, near_edges, contacts);
  const double still = kApproach * capture_distance_m_ / dt_s;
  int captured = 0;
  for (const NearPair& candidate : near) {
    if (candidate.gap_m >= capture_distance_m_) continue;
    if (contacts->overlapping && candidate.gap_m < 0) continue;  // on its way out
    const Triangle& tri = model_.triangles[candidate.triangle];
    Vec3 surface = Vec3::Zero();
    for (int k = 0; k < 3; ++k) surface += candidate.weights(k) * state.velocity_m_s[tri[k]];
    const double speed = candidate.normal.dot(state.velocity_m_s[candidate.particle] - surface);
    // What may slide does no harm before it comes nearer.
    if (!slides() && candidate.gap_m >= 0 && speed >= -still) continue;
    if (LetGo(candidate.particle, candidate.body, candidate.gap_m, *contacts)) continue;
    Bond bond;
    bond.particle = candidate.particle;
    bond.triangle = candidate.triangle;
    bond.side = candidate.side;
    bond.gap_sign = candidate.gap_m < 0 ? -1 : 1;
    bond.gap_m = candidate.gap_m;
    for (int k = 0; k < 3; ++k) bond.weights[k] = candidate.weights(k);
    ShowMembers(&bond);
    bond.sliding = slides();
    if (IsBonded(candidate, *contacts)) {
      if (bond.sliding) continue;  // FollowSliding keeps it where it touches
      // Something that is not a member brings them nearer all the same: a corner of little weight,
      // or another triangle. It becomes one.
      for (std::int32_t& v : bond.vertices) {
        if (v >= 0 && LetGo(v, model_.body_of[bond.particle], bond.gap_m, *contacts)) v = -1;
      }
      if (InOneZone(bond, *contacts)) continue;
    }
    captured += Hold(bond, contacts, report);
  }
  captured += CaptureEdges(near_edges, state, still, contacts, report);
  if (slides()) {
    captured += static_cast<int>(std::erase_if(
        contacts->bonds, [](const Bond& bond) { return bond.sliding && std::isinf(bond.gap_m); }));
  }
  report->captures += captured;
  return captured;
}

// The corners and ends that take part.
void Adhesive::ShowMembers(Bond* bond) const {
  for (int k = 0; k < 3; ++k) {
    const bool member = bond->weights[k] > LeastWeight(bond->gap_m);
    bond->vertices[k] = member ? model_.triangles[bond->triangle][k] : -1;
  }
  if (bond->partner < 0) return;
  bond->holds_particle = 1 - bond->partner_weight > LeastWeight(bond->gap_m);
  bond->holds_partner = bond->partner_weight > LeastWeight(bond->gap_m);
}

std::pair<std::int32_t, std::int32_t> Adhesive::BodiesOf(const Bond& bond) const {
  return std::minmax(model_.body_of[bond.particle],
                     model_.body_of[model_.triangles[bond.triangle][0]]);
}

int Adhesive::FollowSliding(std::span<const NearPair> near, Contacts* contacts) {
  // All that friction holds between two bodies sticks at the same time: a few that stick would have
  // to carry everything.
  calm_.clear();
  for (const Bond& bond : contacts->bonds) {
    if (bond.sliding && bond.calm >= kCalm) calm_.push_back(BodiesOf(bond));
  }
  std::sort(calm_.begin(), calm_.end());
  int changes = 0;
  for (Bond& bond : contacts->bonds) {
    if (!bond.sliding) continue;
    if (bond.calm > 0 && std::binary_search(calm_.begin(), calm_.end(), BodiesOf(bond))) {
      bond.sliding = false;
      ++changes;
    }
    if (bond.partner >= 0) {  // those that Capture() does not find again go
      if (bond.sliding) bond.gap_m = std::numeric_limits<double>::infinity();
      continue;
    }
    const int body = model_.body_of[model_.triangles[bond.triangle][0]];
    const auto pair = std::lower_bound(
        near.begin(), near.end(), std::pair(bond.particle, body),
        [](const NearPair& a, auto b) { return std::pair(a.particle, a.body) < b; });
    if (pair == near.end() || pair->particle != bond.particle || pair->body != body ||
        pair->gap_m > release_distance_m_) {
      bond.triangle = -1;
      ++changes;
      continue;
    }
    changes += bond.triangle != pair->triangle;
    bond.triangle = pair->triangle;
    for (int k = 0; k < 3; ++k) bond.weights[k] = pair->weights(k);
    bond.gap_m = pair->gap_m;
    bond.gap_sign = pair->gap_m < 0 ? -1 : 1;
    if (model_.bodies[body].closed) {
      bond.side = pair->side;
    } else if (pair->side != bond.side) {  // an open surface has been crossed: back to its side
      bond.gap_sign = -1;
      bond.gap_m = -pair->gap_m;
    }
    ShowMembers(&bond);
  }
  if (changes == 0) return 0;
  std::erase_if(contacts->bonds, [](const Bond& bond) { return bond.triangle < 0; });
  std::sort(contacts->bonds.begin(), contacts->bonds.end(), [](const Bond& a, const Bond& b) {
    return Key(a) != Key(b) ? KeyLess(a, b) : a.sliding < b.sliding;
  });
  // One that sticks there already takes the place of one that has slid there.
  const auto same = [](const Bond& a, const Bond& b) { return Key(a) == Key(b); };
  contacts->bonds.erase(std::unique(contacts->bonds.begin(), contacts->bonds.end(), same),
                        contacts->bonds.end());
  return changes;
}

void Adhesive::EndSliding(int b, bool held, bool parted, Contacts* contacts) {
  Bond& bond = contacts->bonds[b];
  bond.calm = held ? std::min(bond.calm + 1, kCalm) : 0;
  if (!parted) return;
  AddReleased(bond.particle, model_.body_of[model_.triangles[bond.triangle][0]], bond.gap_m,
              contacts);
  bond.triangle = -1;
}

int Adhesive::RemoveParted(Contacts* contacts) {
  return static_cast<int>(
      std::erase_if(contacts->bonds, [](const Bond& bond) { return bond.triangle < 0; }));
}

bool Adhesive::IsBonded(const NearPair& pair, const Contacts& contacts) const {
  auto it = std::lower_bound(contacts.bonds.begin(), contacts.bonds.end(), pair.particle,
                             [](const Bond& bond, int p) { return bond.particle < p; });
  for (; it != contacts.bonds.end() && it->particle == pair.particle; ++it) {
    if (it->partner < 0 && model_.body_of[model_.triangles[it->triangle][0]] == pair.body) {
      return true;
    }
  }
  return false;
}

bool Adhesive::HeldAgainst(int tool, int particle, const Contacts& contacts) const {
  const int z = contacts.zone_of[particle];
  if (model_.fixed[particle]) return true;
  if (z < 0) return false;
  const Zone& zone = contacts.zones[z];
  return zone.pins > 0 || (zone.tool >= 0 && zone.tool != tool);
}

int Adhesive::CaptureByTools(std::span<const NearTool> near, const State& state, Contacts* contacts,
                             StepReport* report) {
  const int tools = static_cast<int>(model_.tools.size());
  std::fill(touched_.begin(), touched_.end(), 0);
  for (const NearTool& pair : near) {
    for (int p : model_.triangles[pair.triangle]) touched_[p * tools + pair.tool] = 1;
  }
  std::erase_if(contacts->released, [&](const ReleasedPair& released) {
    return released.other < 0 && !touched_[released.particle * tools + (-1 - released.other)];
  });
  int captured = 0;
  for (const NearTool& pair : near) {
    if (pair.gap_m >= capture_distance_m_ || !(pair.approaching || pair.gap_m < 0)) continue;
    Bond bond;
    bond.tool = pair.tool;
    bond.triangle = pair.triangle;
    bond.sticky = pair.sticky;
    bond.gap_m = pair.gap_m;
    bond.tool_normal = state.tools[pair.tool].pose.orientation.conjugate() * pair.normal;
    bool adds = false;
    for (int k = 0; k < 3; ++k) {
      bond.weights[k] = pair.weights(k);
      const int v = model_.triangles[pair.triangle][k];
      const ReleasedPair* released = FindReleased(*contacts, v, ToolKey(pair.tool));
      const bool eligible = pair.weights(k) > kMinWeight && !HeldAgainst(pair.tool, v, *contacts) &&
                            !(released && pair.gap_m >= released->gap_m);
      bond.vertices[k] = eligible ? v : -1;
      // A particle that the tool already holds needs no second bond.
      const int zone = contacts->zone_of[v];
      adds = adds || (eligible && (zone < 0 || contacts->zones[zone].tool != pair.tool));
    }
    if (!adds) continue;
    const auto at = std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond, KeyLess);
    if (at != contacts->bonds.end() && Key(*at) == Key(bond)) {
      // The contact point may have moved: what it held, it keeps.
      for (int k = 0; k < 3; ++k) bond.vertices[k] = std::max(bond.vertices[k], at->vertices[k]);
      *at = bond;
      ++captured;
    } else {
      captured += Insert(bond, contacts, report);
    }
  }
  report->captures += captured;
  return captured;
}

// From the triangle (or tool) to the particle's (or tissue's) side.
Vec3 Adhesive::BondNormal(const Bond& bond, const State& state) const {
  if (bond.tool >= 0) return state.tools[bond.tool].pose.orientation * bond.tool_normal;
  return GeometryOf(bond, model_, state.position_m).normal;
}

void Adhesive::Strengths(int tool, bool sticky, double area_m2, double mass_kg, double scale,
                         Limit* limit) const {
  BondLimit one = LimitOf(*model_.adhesive, area_m2, mass_kg);
  if (tool >= 0) {
    const Strength strength = sticky ? model_.tools[tool].strength : Strength{0, 0};
    one = {scale * strength.normal_pa * area_m2, scale * strength.shear_pa * area_m2};
  }
  limit->may_slide = limit->may_slide && tool < 0 && model_.adhesive->friction_coefficient;
  // What has several bonds is held by its strongest.
  limit->normal_n = std::max(limit->normal_n, one.normal_n);
  limit->shear_n = std::max(limit->shear_n, one.shear_n);
}

void Adhesive::Limits(int particle, const Bond& bond, const Vec3& normal, double scale) {
  Limit& limit = limit_[particle];
  if (!limit.bonded) limit = {Vec3::Zero(), 0, 0, true, true, false, false};
  limit.normal_sum += normal;
  Strengths(bond.tool, bond.sticky, model_.area_m2[particle], model_.mass_kg[particle], scale,
            &limit);
}

void Adhesive::CollectLimits(const State& state, std::span<const double> strength_scale,
                             const Contacts& contacts) {
  for (int p : contacts.zone_members) limit_[p].bonded = false;
  for (const Bond& bond : contacts.bonds) {
    if (bond.sliding) continue;
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
    return {over(shear, limit.shear_n - tension * *model_.adhesive->friction_coefficient), true,
            false};
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

int Adhesive::ReleasePatch(std::span<const Vec3> load_n, double chance_s, const Contacts& contacts,
                           Zone* zone) {
  int released = 0;
  // Members ascend, and so do their bodies.
  for (int k = zone->first, end; k < zone->first + zone->count; k = end) {
    const int first = contacts.zone_members[k];
    const int body = model_.body_of[first];
    Limit whole{Vec3::Zero(), 0, 0, true, true, false, false};
    Vec3 load = Vec3::Zero();
    bool fixed = false;
    for (end = k; end < zone->first + zone->count; ++end) {
      const int p = contacts.zone_members[end];
      if (model_.body_of[p] != body) break;
      if (!limit_[p].bonded) continue;
      fixed = fixed || model_.fixed[p];
      whole.normal_sum += limit_[p].normal_sum;
      whole.normal_n += limit_[p].normal_n;
      whole.shear_n += limit_[p].shear_n;
      whole.may_slide = whole.may_slide && limit_[p].may_slide;
      load += load_n[p];
    }
    if (fixed) continue;  // its load is not of the contact alone; the other side decides
    const Demand demand = DemandOn(whole, load);
    zone->load = std::max(zone->load, demand.ratio);
    if (demand.ratio <= 1 && !TakenByChance(first, demand, load, chance_s, contacts)) continue;
    for (int m = k; m < end; ++m) {
      Limit& limit = limit_[contacts.zone_members[m]];
      if (limit.bonded) (demand.slides ? limit.slides : limit.released) = true;
    }
    ++released;
  }
  return released;
}

int Adhesive::Release(std::span<const Vec3> load_n, const State& state,
                      std::span<const double> strength_scale, double chance_s, Contacts* contacts) {
  if (contacts->bonds.empty()) return 0;
  contacts->draws += model_.adhesive->bell && chance_s > 0;
  CollectLimits(state, strength_scale, *contacts);
  bond_verdict_.assign(contacts->bonds.size(), 0);
  int released = 0;
  for (Zone& zone : contacts->zones) {
    zone.load = 0;
    const bool patch = model_.adhesive->patch_size_m && zone.tool < 0 && zone.rigid_body < 0;
    released += patch ? ReleasePatch(load_n, chance_s, *contacts, &zone)
                      : ReleaseParticles(load_n, chance_s, *contacts, &zone);
  }
  released += rigid_.Release(
      *contacts, load_n, [&](const Bond& bond) { return BondNormal(bond, state); },
      [&](const RigidInterfaces::Cut& cut) {
        Limit limit{cut.normal_sum, 0, 0, true, true, false, false};
        Strengths(cut.tool, cut.sticky, cut.area_m2, cut.mass_kg,
                  cut.tool >= 0 ? strength_scale[cut.tool] : 1, &limit);
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
    if (bond.sliding) continue;
    const int body = model_.body_of[model_.triangles[bond.triangle][0]];
    const int other = bond.tool >= 0 ? ToolKey(bond.tool) : model_.body_of[bond.particle];
    const auto lets_go = [&](int p) { return bond_verdict_[b] == kLetsGo || limit_[p].released; };
    bool slides = bond_verdict_[b] == kSlides;
    bond.ForEachMember([&](int p) { slides = slides || limit_[p].slides; });
    for (std::int32_t& v : bond.vertices) {
      if (v < 0 || !lets_go(v)) continue;
      AddReleased(v, other, bond.gap_m, contacts);
      v = -1;
    }
    if (bond.tool >= 0) continue;
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
      bond.calm = 0;
      ShowMembers(&bond);
    }
  }
  std::erase_if(contacts->bonds, [&](const Bond& bond) { return !bond.Holds(); });
}

int Adhesive::ReleaseTool(int tool, Contacts* contacts) {
  return static_cast<int>(
      std::erase_if(contacts->bonds, [&](const Bond& bond) { return bond.tool == tool; }));
}

}  // namespace adhesim
