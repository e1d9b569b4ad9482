// The part of the adhesive that is about edges over edges.

#include <algorithm>

#include "core/contact/adhesive.h"

namespace adhesim {

// Of the edges within d_off, (particle, other body) of all ends.
void Adhesive::ListEdgeEnds(std::span<const NearEdges> near) {
  edge_near_.clear();
  for (const NearEdges& pair : near) {
    if (pair.gap_m > release_distance_m_) continue;
    const Triangle& tri = model_.triangles[pair.triangle];
    for (int p : pair.ends) edge_near_.emplace_back(p, model_.body_of[tri[0]]);
    for (int k = 0; k < 3; ++k) {
      if (pair.weights(k) > 0) edge_near_.emplace_back(tri[k], model_.body_of[pair.ends[0]]);
    }
  }
  std::sort(edge_near_.begin(), edge_near_.end());
}

int Adhesive::CaptureEdges(std::span<const NearEdges> near, const State& state, double still_m_s,
                           Contacts* contacts, StepReport* report) {
  int captured = 0;
  for (const NearEdges& pair : near) {
    if (pair.gap_m >= capture_distance_m_) continue;
    const std::vector<Vec3>& v = state.velocity_m_s;
    const Triangle& tri = model_.triangles[pair.triangle];
    Vec3 velocity = (1 - pair.s) * v[pair.ends[0]] + pair.s * v[pair.ends[1]];
    for (int k = 0; k < 3; ++k) velocity -= pair.weights(k) * v[tri[k]];
    if (pair.gap_m >= 0 && pair.normal.dot(velocity) >= -still_m_s) continue;
    const Bond bond = BondOf(pair, state);
    if (InOneZone(bond, *contacts) || LetGoBefore(bond, *contacts)) continue;
    captured += Hold(bond, contacts, report);
  }
  return captured;
}

Bond Adhesive::BondOf(const NearEdges& near, const State& state) const {
  const Triangle& tri = model_.triangles[near.triangle];
  Bond bond;
  bond.particle = near.ends[0];
  bond.partner = near.ends[1];
  bond.partner_weight = near.s;
  bond.holds_particle = 1 - near.s > LeastWeight(near.gap_m);
  bond.holds_partner = near.s > LeastWeight(near.gap_m);
  bond.triangle = near.triangle;
  bond.gap_sign = near.gap_m < 0 ? -1 : 1;
  bond.gap_m = near.gap_m;
  for (int k = 0; k < 3; ++k) {
    bond.weights[k] = near.weights(k);
    bond.vertices[k] = near.weights(k) > LeastWeight(near.gap_m) ? tri[k] : -1;
  }
  bond.side = EdgeCross(bond, state).dot(near.normal) < 0 ? -1 : 1;
  return bond;
}

// Nothing can bring the edges nearer where all ends move as one already.
bool Adhesive::InOneZone(const Bond& bond, const Contacts& contacts) {
  int zone = -2;
  bool one = true;
  bond.ForEachMember([&](int p) {
    one = one && contacts.zone_of[p] >= 0 && (zone == -2 || contacts.zone_of[p] == zone);
    zone = contacts.zone_of[p];
  });
  return one;
}

// Whether one of the ends let go of the other body.
bool Adhesive::LetGoBefore(const Bond& bond, const Contacts& contacts) const {
  const int body = model_.body_of[bond.particle];
  const int other = model_.body_of[model_.triangles[bond.triangle][0]];
  bool let_go = false;
  bond.ForEachMember([&](int p) {
    const bool first = p == bond.particle || p == bond.partner;
    let_go = let_go || LetGo(p, first ? other : body, bond.gap_m, contacts);
  });
  return let_go;
}

// The cross product of the two edges.
Vec3 Adhesive::EdgeCross(const Bond& bond, const State& state) const {
  const Triangle& tri = model_.triangles[bond.triangle];
  const int k = OppositeCorner(bond.weights);
  const std::vector<Vec3>& x = state.position_m;
  return (x[bond.partner] - x[bond.particle]).cross(x[tri[(k + 2) % 3]] - x[tri[(k + 1) % 3]]);
}

// From the triangle's edge to the other.
Vec3 Adhesive::EdgeNormal(const Bond& bond, const State& state) const {
  const Triangle& tri = model_.triangles[bond.triangle];
  const std::vector<Vec3>& x = state.position_m;
  Vec3 offset =
      (1 - bond.partner_weight) * x[bond.particle] + bond.partner_weight * x[bond.partner];
  for (int k = 0; k < 3; ++k) offset -= bond.weights[k] * x[tri[k]];
  const double distance = offset.norm();
  if (distance > 1e-3 * capture_distance_m_) return offset * (bond.gap_sign / distance);
  return EdgeCross(bond, state).normalized() * bond.side;
}

}  // namespace adhesim
