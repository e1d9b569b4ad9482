#include "core/contact/adhesive.h"

#include <algorithm>
#include <cmath>

#include "core/model/carried.h"

namespace adhesim {
namespace {

// Slower than this fraction of d_on per step is round-off, not approach.
constexpr double kApproach = 1e-9;
// Less than this share of d_on is not closer: a zone keeps gaps, but for round-off.
constexpr double kCloser = 1e-6;

bool PairLess(const ReleasedPair& a, const ReleasedPair& b) {
  return a.particle != b.particle ? a.particle < b.particle : a.other < b.other;
}

}  // namespace

std::tuple<int, int, int, int, int> Adhesive::Key(const Bond& bond) {
  return {bond.particle, bond.partner, bond.tool, bond.triangle,
          bond.partner >= 0 ? OppositeCorner(bond.weights) : 0};
}

Adhesive::Adhesive(const Model& model)
    : model_(model), patches_(model), rigid_(model), carried_(model) {
  if (model.adhesive) {
    capture_distance_m_ = model.adhesive->capture_distance_m;
    release_distance_m_ = model.adhesive->release_distance_m;
  }
  MeasureMeshes();
  limit_.resize(model.rest_position_m.size());
  crack_area_m2_.resize(model.rest_position_m.size());
  if (!patches_.empty()) {
    patch_list_.reserve(model.rest_position_m.size());
    patch_members_.reserve(model.rest_position_m.size());
  }
  bond_verdict_.reserve(4 * model.rest_position_m.size() + 64);
  touched_.resize(model.rest_position_m.size() * model.tools.size());
  calm_.reserve(4 * model.rest_position_m.size() + 64);
  moves_with_.reserve(model.rest_position_m.size());
  told_.reserve(8 * model.rest_position_m.size() + 64);  // as the detector's
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
  bond.calm = at->calm;
  bond.Continue(*at);
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
    if (released.other < 0 || Sleeps(released.particle) || (sleep_ && sleep_->Of(released.other))) {
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
  const int cut = model_.adhesive->patch_size_m ? CutAgain(contacts) : 0;
  const double still = kApproach * capture_distance_m_ / dt_s;
  const int apart = DropApart(state.position_m, contacts);
  int captured = 0;
  for (const NearPair& candidate : near) {
    if (candidate.gap_m >= capture_distance_m_) continue;
    // What moves as one does not approach.
    if (!slides() && candidate.gap_m >= 0 && MoveAsOne(*contacts, candidate)) continue;
    const int body = model_.body_of[candidate.particle];
    if (Ties(body, candidate.body) && (!TiesParticlesOf(body, candidate.body) ||
                                       IsTied(candidate.particle, candidate.body, *contacts))) {
      continue;
    }
    const Triangle& tri = model_.triangles[candidate.triangle];
    Vec3 surface = Vec3::Zero();
    for (int k = 0; k < 3; ++k) surface += candidate.weights(k) * state.velocity_m_s[tri[k]];
    const double speed = candidate.normal.dot(state.velocity_m_s[candidate.particle] - surface);
    const bool leaves = contacts->overlapping && speed >= -still;
    if (candidate.gap_m < 0 && leaves) continue;  // on its way out
    // What may slide does no harm before it comes nearer.
    if (!slides() && candidate.gap_m >= 0 && speed >= -still) continue;
    if (LetGo(candidate.particle, candidate.body, candidate.gap_m, *contacts)) continue;
    Bond bond = BondOf(candidate, state.time_s);
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
  report->captures += captured;
  if (!slides()) return captured + apart + cut;
  const auto passed = [](const Bond& bond) { return bond.sliding && std::isinf(bond.gap_m); };
  return captured + apart + cut + static_cast<int>(std::erase_if(contacts->bonds, passed));
}

Bond Adhesive::BondOf(const NearPair& near, double time_s) const {
  Bond bond;
  bond.since_s = time_s;
  bond.particle = near.particle;
  bond.triangle = near.triangle;
  bond.side = near.side;
  bond.gap_sign = near.gap_m < 0 ? -1 : 1;
  bond.gap_m = near.gap_m;
  for (int k = 0; k < 3; ++k) bond.weights[k] = near.weights(k);
  ShowMembers(&bond);
  bond.sliding = slides();
  return bond;
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
  return ItOrItsCarriers(particle, [&](int p) {  // they would have to come along
    if (model_.fixed[p]) return true;
    const int z = contacts.zone_of[p];
    if (z < 0) return false;
    const Zone& zone = contacts.zones[z];
    return zone.pins > 0 || (zone.tool >= 0 && zone.tool != tool);
  });
}

bool Adhesive::HeldBy(int tool, int particle, const Contacts& contacts) const {
  return ItOrItsCarriers(particle, [&](int p) {
    return contacts.zone_of[p] >= 0 && contacts.zones[contacts.zone_of[p]].tool == tool;
  });
}

bool Adhesive::HeldAgainst(const NearTool& near, const Contacts& contacts) const {
  return ACornerIs(near, [&](int p) { return HeldAgainst(near.tool, p, contacts); });
}

bool Adhesive::HeldBy(int tool, const NearTool& near, const Contacts& contacts) const {
  return ACornerIs(near, [&](int p) { return HeldBy(tool, p, contacts); });
}

// With the members that may be: of some weight, not held against the tool, and not released from
// it.
Bond Adhesive::BondOf(const NearTool& near, const State& state, const Contacts& contacts) const {
  Bond bond;
  bond.since_s = state.time_s;
  bond.tool = near.tool;
  bond.triangle = near.triangle;
  bond.sticky = near.sticky;
  bond.gap_m = near.gap_m;
  bond.tool_normal = state.tools[near.tool].pose.orientation.conjugate() * near.normal;
  bond.sliding = model_.tools[near.tool].friction_coefficient.has_value();
  for (int k = 0; k < 3; ++k) {
    bond.weights[k] = near.weights(k);
    const int v = model_.triangles[near.triangle][k];
    const ReleasedPair* released = FindReleased(contacts, v, ToolKey(near.tool));
    const bool eligible = near.weights(k) > kMinWeight && !HeldAgainst(near.tool, v, contacts) &&
                          !(released && near.gap_m >= released->gap_m);
    bond.vertices[k] = eligible ? v : -1;
  }
  return bond;
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
    const bool slides = model_.tools[pair.tool].friction_coefficient.has_value();
    if (pair.gap_m >= capture_distance_m_) continue;
    // What may slide does no harm before it comes nearer.
    if (!slides && !(pair.approaching || pair.gap_m < 0)) continue;
    Bond bond = BondOf(pair, state, *contacts);
    bool adds = false;
    for (const std::int32_t v : bond.vertices) {
      if (v < 0) continue;
      // A particle that the tool already holds needs no second bond.
      const int zone = contacts->zone_of[v];
      adds = adds || zone < 0 || contacts->zones[zone].tool != pair.tool;
    }
    if (!adds) continue;
    const auto at = std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond, KeyLess);
    if (at != contacts->bonds.end() && Key(*at) == Key(bond)) {
      if (slides) continue;  // FollowSlidingOnTools() keeps it where it touches, or it sticks
      // The contact point may have moved: what it held, it keeps.
      for (int k = 0; k < 3; ++k) bond.vertices[k] = std::max(bond.vertices[k], at->vertices[k]);
      bond.Continue(*at);
      *at = bond;
      ++captured;
    } else {
      captured += Insert(bond, contacts, report);
    }
  }
  report->captures += captured;
  return captured;
}

}  // namespace adhesim
