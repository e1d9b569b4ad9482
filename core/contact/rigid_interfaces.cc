#include "core/contact/rigid_interfaces.h"

#include <algorithm>
#include <tuple>

namespace adhesim {

RigidInterfaces::RigidInterfaces(const Model& model) : model_(model) {
  const std::size_t nodes = model.bodies.size() + model.tools.size();
  held_.assign(nodes, 1);
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    any_rigid_ = any_rigid_ || body.rigid;
    const auto first = model.fixed.begin() + body.first_particle;
    held_[b] = std::count(first, first + body.particle_count, 1) > 0;
  }
  reached_.assign(nodes, 0);
  edges_.reserve(16 * nodes + 64);
  edge_of_bond_.reserve(4 * model.rest_position_m.size() + 64);
  stamp_.assign(model.rest_position_m.size(), -1);
}

int RigidInterfaces::FirstNode(const Bond& bond) const {
  return bond.particle >= 0 ? model_.body_of[bond.particle]
                            : static_cast<int>(model_.bodies.size()) + bond.tool;
}

int RigidInterfaces::SecondNode(const Bond& bond) const {
  return model_.body_of[model_.triangles[bond.triangle][0]];
}

void RigidInterfaces::CollectEdges(const Contacts& contacts) {
  std::fill(stamp_.begin(), stamp_.end(), -1);
  edges_.clear();
  edge_of_bond_.assign(contacts.bonds.size(), -1);
  const auto less = [](const Edge& e, const Edge& f) {
    return std::tie(e.zone, e.a, e.b) < std::tie(f.zone, f.a, f.b);
  };
  const auto edge_of = [&](const Bond& bond) {
    int member = -1;
    bond.ForEachMember([&](int p) { member = p; });
    const auto [a, b] = std::minmax({FirstNode(bond), SecondNode(bond)});
    return Edge{bond.sliding || bond.tied ? -1 : contacts.zone_of[member], a, b};
  };
  // Only zones with a rigid body have an interface between rigid things.
  const auto relevant = [&](const Edge& edge) {
    return edge.zone >= 0 && edge.a != edge.b && contacts.zones[edge.zone].rigid_body >= 0;
  };
  for (const Bond& bond : contacts.bonds) {
    const Edge edge = edge_of(bond);
    if (!relevant(edge) || edges_.size() == edges_.capacity()) continue;
    const auto at = std::lower_bound(edges_.begin(), edges_.end(), edge, less);
    if (at == edges_.end() || less(edge, *at)) edges_.insert(at, edge);
  }
  for (std::size_t b = 0; b < contacts.bonds.size() && !edges_.empty(); ++b) {
    const Edge edge = edge_of(contacts.bonds[b]);
    const auto at = std::lower_bound(edges_.begin(), edges_.end(), edge, less);
    if (at != edges_.end() && !less(edge, *at))
      edge_of_bond_[b] = static_cast<int>(at - edges_.begin());
  }
}

// Marks the nodes that are connected to `from` in its zone but for edge `without`. True when none
// of them is held and the other end of that edge is not among them.
bool RigidInterfaces::Reach(int from, int without) {
  std::fill(reached_.begin(), reached_.end(), 0);
  reached_[from] = 1;
  for (bool grown = true; grown;) {
    grown = false;
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      const Edge& edge = edges_[e];
      if (static_cast<int>(e) == without || edge.zone != edges_[without].zone) continue;
      if (reached_[edge.a] != reached_[edge.b]) {
        reached_[edge.a] = reached_[edge.b] = 1;
        grown = true;
      }
    }
  }
  const int other = edges_[without].a == from ? edges_[without].b : edges_[without].a;
  bool held = reached_[other] != 0;
  for (std::size_t n = 0; n < reached_.size(); ++n) held = held || (reached_[n] && held_[n]);
  return !held;
}

bool RigidInterfaces::CutEdge(int e, const Contacts& contacts, std::span<const Vec3> load_n,
                              Cut* cut) {
  const Edge edge = edges_[e];
  if (!RigidNode(edge.a) || !RigidNode(edge.b)) return false;
  if (Reach(edge.a, e)) {
    cut->node = edge.a;
  } else if (Reach(edge.b, e)) {
    cut->node = edge.b;
  } else {
    return false;
  }
  cut->zone = edge.zone;
  const Zone& zone = contacts.zones[edge.zone];
  for (int k = zone.first; k < zone.first + zone.count; ++k) {
    const int p = contacts.zone_members[k];
    if (reached_[model_.body_of[p]]) cut->load_n += load_n[p];
  }
  return true;
}

}  // namespace adhesim
