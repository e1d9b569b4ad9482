#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// The generalised winding number of a surface (Jacobson, Kavan, Sorkine-Hornung 2013): the sum of
// the solid angles of its triangles, seen from a point, over 4 pi. Around a closed, outward surface
// it is 1 inside and 0 outside; holes and self-intersections only blur it. Fast by a tree of
// dipoles (Barill, Dickson, Schmidt, Levin, Jacobson 2018, first order): what is further away than
// kFar of its own radii counts as one vector area at its centre. Against the full sum that is off
// by less than 0.03. No libm function but the square root: the same bits on every machine.
class WindingNumber {
 public:
  explicit WindingNumber(const TriangleMesh& mesh);
  double At(const Vec3& point) const;

 private:
  static constexpr int kLeafTriangles = 4;
  static constexpr double kFar = 2.3;

  struct Node {
    Vec3 centre;                        // weighted by area
    Vec3 area_m2;                       // sum of area vectors
    double far_sq = 0;                  // square of the distance from which it counts as a dipole
    std::int32_t next = 0;              // the node after this one and all below it
    std::int32_t first = 0, count = 0;  // triangles of a leaf; 0: not a leaf
  };

  void Build(const TriangleMesh& mesh, std::int32_t* first, std::int32_t* last);

  std::vector<Node> nodes_;                   // depth first
  std::vector<std::array<Vec3, 3>> corners_;  // of triangles, in the leaves' order
};

}  // namespace adhesim
