#pragma once

#include <absl/status/statusor.h>

#include "core/model/geometry.h"

namespace adhesim {

// Closed and open surfaces, outward-oriented (sheets: normal +z), in a fixed vertex order.
TriangleMesh MakeIcosphere(double radius_m, int subdivisions);  // 10*4^n+2 / 20*4^n
TriangleMesh MakeSheet(double length_m, double width_m, int columns, int rows);
TriangleMesh MakeBlock(const Vec3& size_m, int cells);

// A closed, smooth, liver-like solid of our own, `length_m` along x, about `particles` vertices
// (50..200000): voxels that go the way of a segmented organ (surface_from_labels.h), so that every
// scene with it exercises that way.
absl::StatusOr<TriangleMesh> MakeOrgan(double length_m, int particles);

}  // namespace adhesim
