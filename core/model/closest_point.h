#pragma once

#include "core/model/geometry.h"

namespace adhesim {

// The point of a triangle nearest to a point.
struct ClosestPoint {
  // Where it lies: inside, on the edge from corner k to k + 1, or at corner k.
  enum Feature : std::int8_t { kFace, kEdge0, kEdge1, kEdge2, kCorner0, kCorner1, kCorner2 };

  Vec3 weights;  // barycentric coordinates
  Feature feature;
  double distance_sq_m2;
};

// Ericson, Real-Time Collision Detection (2005), section 5.1.5. A triangle of no area is its edges.
ClosestPoint ClosestPointOnTriangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace adhesim
