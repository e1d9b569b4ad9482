#pragma once

#include <absl/status/statusor.h>

#include "core/model/geometry.h"
#include "core/scene/mesh/label_map.h"

namespace adhesim {

// A point p of the surface was at origin_m + p / scale in the image, whose first voxel fills the
// box from 0 to the spacing.
struct PlaceInImage {
  Vec3 origin_m = Vec3::Zero();
  double scale = 1;
};

// A closed, even surface of `particles` vertices (within 2 %) around the largest connected solid of
// an image, without its cavities; centred on its centre of volume and with the solid's volume.
// Steps: average into cubic cells, marching tetrahedra, Taubin smoothing, edge collapse. The same
// bytes every time: no hashing, no libm function but the square root. Errors: nothing solid, or a
// solid too small or too ragged for so many vertices.
// `place` (may be null) is where the surface was in the image.
absl::StatusOr<TriangleMesh> SurfaceFromLabels(const SolidMap& map, int particles,
                                               PlaceInImage* place = nullptr);

}  // namespace adhesim
