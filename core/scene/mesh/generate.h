#pragma once

#include "core/model/geometry.h"

namespace adhesim {

// Closed and open surfaces, outward-oriented (sheets: normal +z), in a fixed vertex order.
TriangleMesh MakeIcosphere(double radius_m, int subdivisions);  // 10*4^n+2 / 20*4^n
TriangleMesh MakeSheet(double length_m, double width_m, int columns, int rows);
TriangleMesh MakeBlock(const Vec3& size_m, int cells);
TriangleMesh MakeOrgan(double length_m, int particles);  // liver-like, closed

}  // namespace adhesim
