#pragma once

#include <span>
#include <vector>

#include "core/contact/patches.h"
#include "core/model/carried.h"
#include "core/model/disjoint_sets.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Makes the zones from the bonds: connected components of the colliding particles, joined by bonds
// and by mesh edges (union-find). The paper's create, join and merge are what falls out of it, and
// so are the split and the shrinking that it lacks; the result does not depend on the order of
// events (physics notes 3.3, item 3).
//
// With a patch size, zones are cut into patches (Patches), but for what would pass through.
//
// A carried particle takes its carriers along, so that all of them are members.
//
// A rigid body is one node, a tool another. Tools that differ, or a tool and a fixed particle,
// cannot share a zone: the union that would join them is refused and kStepZoneSplitForced says so.
class ZoneBuilder {
 public:
  // Bond::calm of a bond that sticks and joins patches: what would else pass through.
  static constexpr std::int8_t kAcrossPatches = -1;

  explicit ZoneBuilder(const Model& model);

  // Rewrites zones, zone_members and zone_of. Zones keep the number of the old zone that most of
  // their members come from. Removes from the bonds what a refused union made meaningless. True if
  // some zone has lost members, be it to another. Allocates nothing.
  bool Rebuild(Contacts* contacts, StepReport* report);

  // Reserves every array of the contacts that Rebuild and the adhesive fill.
  static void Reserve(const Model& model, Contacts* contacts);

 private:
  static constexpr int kNobody = -1;  // who prescribes a component's motion: nobody,
  static constexpr int kGround = -2;  // a fixed particle, or tool number 0, 1, ...

  // False when their prescribers disagree.
  bool Unite(int a, int b);
  // Unite(), with what carries the particle: all of it moves as one.
  bool UniteMember(int anchor, int particle);
  // Unites a carried particle with its carriers; false when their prescribers disagree.
  bool UniteCarriers(int particle);
  void MarkMember(int particle);
  void KeepCarriersTogether(Bond* bond, StepReport* report);
  int BodyNode(int body) const { return model_.particle_count() + body; }
  int ToolNode(int tool) const {
    return model_.particle_count() + static_cast<int>(model_.bodies.size()) + tool;
  }
  void MarkPatches(const Contacts& contacts);
  bool InOnePatch(int a, int b) const {
    return patches_.empty() || patches_.CubeOf(a) == patches_.CubeOf(b) ||
           model_.bodies[model_.body_of[a]].rigid || model_.bodies[model_.body_of[b]].rigid;
  }
  void UniteBonds(Contacts* contacts, StepReport* report);
  void UniteRigidBodies();
  void UniteMeshEdges();
  void CollectZones(Contacts* contacts);
  // Returns the number of old zones of which no member left.
  int KeepIds(Contacts* contacts);

  const Model& model_;
  DisjointSets sets_;                       // of [#particles + #bodies + #tools] nodes
  std::vector<std::int32_t> prescriber_;    // of a root, likewise
  std::vector<std::uint8_t> member_;        // [#particles] is in some zone
  std::vector<std::uint8_t> colliding_;     // [#particles] is part of some bond
  std::vector<std::int32_t> zone_at_root_;  // likewise
  CarriedLookup carried_;
  Patches patches_;  // empty: zones are not cut
  // The old zones, to carry their numbers over.
  std::vector<std::int32_t> old_zone_of_;  // [#particles]
  std::vector<std::int32_t> old_id_;       // [#old zones]
  std::vector<std::int32_t> old_size_;     // [#old zones] members
  std::vector<std::int32_t> shared_;       // [#old zones] members shared with the zone looked at
  std::vector<std::int32_t> heir_;         // [#old zones] new zone that takes its number
  std::vector<std::int32_t> heir_shared_;  // [#old zones]
};

}  // namespace adhesim
