#pragma once

#include <absl/status/statusor.h>

#include "core/model/geometry.h"
#include "core/scene/mesh/label_map.h"

namespace adhesim {

// A closed, even surface of `particles` vertices (within 2 %) around the largest connected solid of
// an image, without its cavities; centred on its centre of volume and with the solid's volume.
// Steps: average into cubic cells, marching tetrahedra, Taubin smoothing, edge collapse. The same
// bytes every time: no hashing, no libm function but the square root. Errors: nothing solid, or a
// solid too small or too ragged for so many vertices.
absl::StatusOr<TriangleMesh> SurfaceFromLabels(const SolidMap& map, int particles);

}  // namespace adhesim
