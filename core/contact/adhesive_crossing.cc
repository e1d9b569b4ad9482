// The part of the adhesive that keeps surfaces from passing through each other.

#include <algorithm>
#include <cmath>

#include "core/contact/adhesive.h"
#include "core/contact/penetration.h"
#include "core/contact/zone_builder.h"
#include "core/model/bond_geometry.h"

namespace adhesim {
namespace {

// Nothing comes nearer than this share of the capture distance without being held.
constexpr double kKeep = 0.1;
// Less than this share of it is round-off of a zone's motion, not approach.
constexpr double kApproach = 1e-6;

}  // namespace

std::span<const NearPair> Adhesive::TellInside(std::span<const NearPair> near,
                                               std::span<const Vec3> position_m,
                                               Contacts* contacts) {
  const auto seems_inside = [](const NearPair& pair) { return pair.gap_m < 0; };
  if (std::none_of(near.begin(), near.end(), seems_inside)) return near;
  told_.assign(near.begin(), near.end());
  for (NearPair& pair : told_) {
    if (pair.gap_m >= 0) continue;
    if (IsInside(model_, model_.bodies[pair.body], position_m, position_m[pair.particle])) {
      contacts->overlapping = true;
      continue;
    }
    pair.gap_m = -pair.gap_m;
    pair.normal = -pair.normal;
    pair.side = static_cast<std::int8_t>(-pair.side);
  }
  return told_;
}

int Adhesive::DropInside(Contacts* contacts) {
  return static_cast<int>(std::erase_if(contacts->bonds, [](const Bond& bond) {
    return bond.tool < 0 && !bond.sliding && bond.gap_sign < 0;
  }));
}

bool Adhesive::Approaches(double gap_m, double then_m) const {
  return then_m < kKeep * capture_distance_m_ && then_m < gap_m - kApproach * capture_distance_m_;
}

// Along the line from one contact point to the other as it is now.
bool Adhesive::Crosses(const Bond& bond, const State& state, std::span<const Vec3> moved_m) const {
  const Triangle& tri = model_.triangles[bond.triangle];
  const auto offset = [&](std::span<const Vec3> x) {
    Vec3 sum = x[bond.particle];
    if (bond.partner >= 0)
      sum = (1 - bond.partner_weight) * sum + bond.partner_weight * x[bond.partner];
    for (int k = 0; k < 3; ++k) sum -= bond.weights[k] * x[tri[k]];
    return sum;
  };
  const BondGeometry now = GeometryOf(bond, model_, state.position_m);
  const double then = now.normal.dot(offset(moved_m));
  return Approaches(now.gap_m, then);
}

// What touches in one zone cannot cross, nor can a bond change that: of an aggregate that is nearly
// all, and told from what has any weight, before anything is computed.
bool Adhesive::MoveAsOne(const Contacts& contacts, int triangle, const Vec3& weights, int first,
                         int second) const {
  const int zone = contacts.zone_of[first];
  if (zone < 0 || contacts.zone_of[second] != zone) return false;
  const Triangle& tri = model_.triangles[triangle];
  for (int k = 0; k < 3; ++k) {
    if (weights(k) > 0 && contacts.zone_of[tri[k]] != zone) return false;
  }
  return true;
}

// All corners and ends that have any weight: what is left out could bring the surfaces nearer.
int Adhesive::HoldWhole(Bond bond, Contacts* contacts, StepReport* report) const {
  const Triangle& tri = model_.triangles[bond.triangle];
  for (int k = 0; k < 3; ++k) bond.vertices[k] = bond.weights[k] > 0 ? tri[k] : -1;
  bond.holds_particle = bond.partner < 0 || bond.partner_weight < 1;
  bond.holds_partner = bond.partner >= 0 && bond.partner_weight > 0;
  bond.sliding = false;
  bond.calm = ZoneBuilder::kAcrossPatches;
  const auto at = std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond, KeyLess);
  if (at != contacts->bonds.end() && !KeyLess(bond, *at) && at->tied) return 0;
  if (at != contacts->bonds.end() && !KeyLess(bond, *at) && at->calm != bond.calm) {
    bond.Continue(*at);
    *at = bond;  // it slid, or held within its patch only
    return 1;
  }
  return Hold(bond, contacts, report);
}

// Each look at a trial step says anew what has to be held across patches: what was caught in
// compression must not keep the patches one when they are pulled.
int Adhesive::CutAgain(Contacts* contacts) {
  int cut = 0;
  for (Bond& bond : contacts->bonds) {
    if (bond.tied || bond.calm != ZoneBuilder::kAcrossPatches) continue;
    bond.calm = 0;
    ++cut;
  }
  return cut;
}

int Adhesive::CaptureCrossing(std::span<const NearPair> near, std::span<const NearEdges> near_edges,
                              const State& state, std::span<const Vec3> moved_m, Contacts* contacts,
                              StepReport* report) {
  int captured = 0;
  for (const NearPair& pair : near) {
    if (pair.gap_m < 0) continue;  // inside a body: it may leave
    if (MoveAsOne(*contacts, pair)) continue;
    if (IsTied(pair.particle, pair.body, *contacts)) continue;
    const Bond bond = BondOf(pair, state.time_s);
    if (Crosses(bond, state, moved_m)) captured += HoldWhole(bond, contacts, report);
  }
  for (const NearEdges& pair : near_edges) {
    if (pair.gap_m < 0) continue;
    if (MoveAsOne(*contacts, pair.triangle, pair.weights, pair.ends[0], pair.ends[1])) continue;
    const Bond bond = BondOf(pair, state);
    if (Crosses(bond, state, moved_m)) captured += HoldWhole(bond, contacts, report);
  }
  report->captures += captured;
  return captured;
}

double Adhesive::ComesNearer(const NearTool& pair, const State& state,
                             std::span<const Vec3> moved_m, const Pose& moved_tool) const {
  const Triangle& tri = model_.triangles[pair.triangle];
  Vec3 point = Vec3::Zero(), moved_point = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    point += pair.weights(k) * state.position_m[tri[k]];
    moved_point += pair.weights(k) * moved_m[tri[k]];
  }
  // The tool's own contact point moves with it.
  const Pose& now = state.tools[pair.tool].pose;
  const Vec3 on_tool =
      now.orientation.conjugate() * (point - pair.gap_m * pair.normal - now.position_m);
  const double then = pair.normal.dot(moved_point - moved_tool * on_tool);
  if (!Approaches(pair.gap_m, then)) return 0;
  return std::min(pair.gap_m, kKeep * capture_distance_m_) - then;
}

int Adhesive::CaptureCrossingByTools(std::span<const NearTool> near, const State& state,
                                     std::span<const Vec3> moved_m,
                                     std::span<const Pose> moved_tool, Contacts* contacts,
                                     StepReport* report) {
  int captured = 0;
  for (const NearTool& pair : near) {
    const Triangle& tri = model_.triangles[pair.triangle];
    if (ComesNearer(pair, state, moved_m, moved_tool[pair.tool]) == 0) continue;
    Bond bond = BondOf(pair, state, *contacts);
    for (int k = 0; k < 3; ++k) {
      const bool may = pair.weights(k) > 0 && !HeldAgainst(pair.tool, tri[k], *contacts);
      bond.vertices[k] = may ? tri[k] : -1;
    }
    if (!bond.Holds()) continue;  // the tool stops at what others hold, or gives way to it
    const auto at = std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond, KeyLess);
    if (at == contacts->bonds.end() || Key(*at) != Key(bond)) {
      captured += Insert(bond, contacts, report);
      continue;
    }
    bool more = at->sliding;
    for (int k = 0; k < 3; ++k) {
      more = more || bond.vertices[k] > at->vertices[k];
      bond.vertices[k] = std::max(bond.vertices[k], at->vertices[k]);
    }
    if (!more) continue;
    bond.Continue(*at);
    *at = bond;
    ++captured;
  }
  report->captures += captured;
  return captured;
}

}  // namespace adhesim
