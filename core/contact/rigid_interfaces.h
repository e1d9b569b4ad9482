#pragma once

#include <span>
#include <vector>

#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// What two rigid things carry where they stick to each other.
//
// A rigid body's particles carry its inner forces too, so that the load of one of them says
// nothing; and where a rigid body touches tissue, the tissue's particles decide. Between two rigid
// things (bodies, fixed bodies, tools) the interface is cut: what hangs on one side, and only on
// that side, is the resultant that it carries. Where the sides are connected otherwise too, or both
// are held by something fixed, the share of this interface is undetermined and it holds.
class RigidInterfaces {
 public:
  explicit RigidInterfaces(const Model& model);

  // True when a particle's own load decides about it: its body is not rigid.
  bool DecidesByItself(int particle) const { return !RigidNode(model_.body_of[particle]); }

  struct Cut {
    int zone = -1;
    int node = -1;  // the loaded side
    Vec3 load_n = Vec3::Zero();
    Vec3 normal_sum = Vec3::Zero();   // from the other side to the loaded one
    double area_m2 = 0, mass_kg = 0;  // of the side with the smaller area
    double strength_scale = 1;        // mean of its bonds' over that area
    int tool = -1;                    // the tool of the interface, or -1
    bool sticky = true;
  };

  // Calls judge(cut) for every interface whose load is determined; what that returns, if not
  // zero, becomes `*verdict` [#bonds] of its bonds. Returns the number of interfaces judged so.
  // `normal_of(bond)` is its unit normal.
  template <typename Judge, typename NormalOf>
  int Release(const Contacts& contacts, std::span<const Vec3> load_n, const NormalOf& normal_of,
              const Judge& judge, std::vector<std::uint8_t>* verdict) {
    int count = 0;
    if (!any_rigid_) return count;
    CollectEdges(contacts);
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      Cut cut;
      if (!CutEdge(static_cast<int>(e), contacts, load_n, &cut)) continue;
      Measure(static_cast<int>(e), contacts, normal_of, &cut);
      const std::uint8_t judged = judge(cut);
      if (!judged) continue;
      ++count;
      for (std::size_t b = 0; b < contacts.bonds.size(); ++b) {
        if (edge_of_bond_[b] == static_cast<int>(e)) (*verdict)[b] = judged;
      }
    }
    return count;
  }

 private:
  struct Edge {
    int zone, a, b;  // a < b: bodies, then tools
  };
  bool RigidNode(int node) const {
    return node >= static_cast<int>(model_.bodies.size()) || model_.bodies[node].rigid ||
           model_.bodies[node].all_fixed;
  }
  int FirstNode(const Bond& bond) const;   // of the particle, or the tool
  int SecondNode(const Bond& bond) const;  // of the triangle
  void CollectEdges(const Contacts& contacts);
  bool CutEdge(int edge, const Contacts& contacts, std::span<const Vec3> load_n, Cut* cut);
  bool Reach(int from, int without);
  template <typename NormalOf>
  void Measure(int edge, const Contacts& contacts, const NormalOf& normal_of, Cut* cut);

  const Model& model_;
  bool any_rigid_ = false;                  // bodies, without which there are no interfaces
  std::vector<std::uint8_t> held_;          // [#bodies + #tools] fixed, or driven by a tool
  std::vector<Edge> edges_;                 // between any two nodes; sorted
  std::vector<std::int32_t> edge_of_bond_;  // [#bonds] or -1
  std::vector<std::uint8_t> reached_;       // [#nodes]
  std::vector<std::int32_t> stamp_;         // [#particles] edge that counted it last
};

template <typename NormalOf>
void RigidInterfaces::Measure(int edge, const Contacts& contacts, const NormalOf& normal_of,
                              Cut* cut) {
  double area[2] = {0, 0}, mass[2] = {0, 0}, scaled[2] = {0, 0};
  for (std::size_t b = 0; b < contacts.bonds.size(); ++b) {
    if (edge_of_bond_[b] != edge) continue;
    const Bond& bond = contacts.bonds[b];
    // A bond's normal points to its particle; a tool's to the tissue.
    const bool towards = bond.tool >= 0 || model_.body_of[bond.particle] == cut->node;
    cut->normal_sum += towards ? normal_of(bond) : Vec3(-normal_of(bond));
    bond.ForEachMember([&](int p) {
      if (stamp_[p] == edge) return;
      stamp_[p] = edge;
      const int side = model_.body_of[p] == cut->node ? 0 : 1;
      area[side] += model_.area_m2[p];
      mass[side] += model_.mass_kg[p];
      scaled[side] += bond.strength_scale * model_.area_m2[p];
    });
    if (bond.tool >= 0) {
      cut->tool = bond.tool;
      cut->sticky = bond.sticky;
    }
  }
  const int weaker = cut->tool < 0 && area[1] < area[0] ? 1 : 0;
  cut->area_m2 = area[weaker];
  cut->mass_kg = mass[weaker];
  if (area[weaker] > 0) cut->strength_scale = scaled[weaker] / area[weaker];
}

}  // namespace adhesim
