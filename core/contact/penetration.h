#pragma once

#include <span>

#include "core/model/model.h"

namespace adhesim {

// How far bodies overlap where one of them can move at least: obstacles may be built from parts.
struct Penetration {
  double max_depth_m =
      0;  // largest distance of a particle inside another closed body to that body's surface
  int vertices_inside = 0;  // particles inside another closed body
};

// Whether p is inside the closed body: its winding number (van Oosterom and Strackee 1983).
bool IsInside(const Model& model, const Body& body, std::span<const Vec3> position_m,
              const Vec3& p);

// Exact, by winding numbers; time is #particles x #triangles of overlapping boxes. A diagnostic,
// not for the step.
Penetration MeasurePenetration(const Model& model, std::span<const Vec3> position_m);

// Edges that pass through a triangle of another body, each such pair counted once; of the same body
// too, if `self` (through triangles that share none of their ends). Vertices see nothing of two
// edges that have changed sides. As slow.
int CountEdgesThrough(const Model& model, std::span<const Vec3> position_m, bool self = false);

}  // namespace adhesim
