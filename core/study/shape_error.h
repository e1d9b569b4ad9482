#pragma once

#include <span>

#include "core/model/model.h"

namespace adhesim {

// How far deformable bodies are from their shape at rest, wherever they lie.
struct ShapeError {
  // Largest of any body: root mean square of |l / l_rest - 1| of the edges of its tetrahedra (of
  // its triangles, where it has none), or | V / V_rest - 1 | of what a closed surface encloses.
  double error = 0;
  int inverted = 0;  // tetrahedra without a positive volume
};
ShapeError MeasureShapeError(const Model& model, std::span<const Vec3> position_m);

// Triangles that a tool's axis passes through further than `depth_m` from its tip: what pierced
// something. Zero for a tool that is stopped by what it touches.
int CountPierced(const Model& model, std::span<const Vec3> position_m, const Pose& tool,
                 double length_m, double depth_m);

}  // namespace adhesim
