#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/model/disjoint_sets.h"
#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Which patch a particle is of (`patch_size_m`, mode P of the notes, 3.3, item 9): each particle
// goes with the heaviest of what it is stuck to, and those groups with what is in the same cube at
// rest. It follows from the bonds alone. What is of one patch and of one zone lets go together.
//
// A triangle whose corners are fixed is ground: it holds every patch that sticks to it, and joins
// none, however large it is. There a body is cut by cubes of its own, of which one is in its
// middle.
class Patches {
 public:
  // Empty where the scene has no patches.
  explicit Patches(const Model& model);
  bool empty() const { return cube_.empty(); }
  // Patches of these bonds; allocates nothing.
  void Mark(const Contacts& contacts);
  // The lowest particle of those that go with it.
  int FirstOf(int particle) { return groups_.Root(particle); }
  // Whether the bond, which is not a tool's, sticks to ground.
  static bool ToGround(const Bond& bond, const Model& model) {
    const Triangle& tri = model.triangles[bond.triangle];
    return model.fixed[tri[0]] && model.fixed[tri[1]] && model.fixed[tri[2]];
  }
  // Which cube it goes with.
  using Cube = std::array<std::int32_t, 3>;
  const Cube& CubeOf(int particle) const { return cube_[particle]; }

 private:
  const Model& model_;
  DisjointSets groups_;     // of particles
  std::vector<Cube> cube_;  // [#particles]
};

}  // namespace adhesim
