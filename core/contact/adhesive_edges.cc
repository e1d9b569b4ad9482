// The part of the adhesive that is about edges over edges.

#include <algorithm>

#include "core/contact/adhesive.h"
#include "core/model/bond_geometry.h"

namespace adhesim {

std::span<const std::int32_t> Adhesive::MovesWith(const Contacts& contacts) {
  moves_with_.assign(contacts.zone_of.begin(), contacts.zone_of.end());
  for (const ReleasedPair& pair : contacts.released) moves_with_[pair.particle] = -1;
  return moves_with_;
}

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
    if (contacts->overlapping && pair.gap_m < 0) continue;
    if (Ties(model_.body_of[pair.ends[0]], model_.body_of[model_.triangles[pair.triangle][0]]))
      continue;
    const std::vector<Vec3>& v = state.velocity_m_s;
    const Triangle& tri = model_.triangles[pair.triangle];
    Vec3 velocity = (1 - pair.s) * v[pair.ends[0]] + pair.s * v[pair.ends[1]];
    for (int k = 0; k < 3; ++k) velocity -= pair.weights(k) * v[tri[k]];
    if (!slides() && pair.gap_m >= 0 && pair.normal.dot(velocity) >= -still_m_s) continue;
    const Bond bond = BondOf(pair, state);
    if (InOneZone(bond, *contacts) || LetGoBefore(bond, *contacts)) continue;
    captured += Hold(bond, contacts, report);
  }
  return captured;
}

Bond Adhesive::BondOf(const NearEdges& near, const State& state) const {
  Bond bond;
  bond.since_s = state.time_s;
  bond.particle = near.ends[0];
  bond.partner = near.ends[1];
  bond.partner_weight = near.s;
  bond.triangle = near.triangle;
  bond.gap_sign = near.gap_m < 0 ? -1 : 1;
  bond.gap_m = near.gap_m;
  for (int k = 0; k < 3; ++k) bond.weights[k] = near.weights(k);
  bond.side = EdgeCross(bond, model_, state.position_m).dot(near.normal) < 0 ? -1 : 1;
  bond.sliding = slides();
  ShowMembers(&bond);
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

}  // namespace adhesim
