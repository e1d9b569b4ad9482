#include <algorithm>
#include <cmath>

#include "core/scene/mesh/generate.h"
#include "core/scene/mesh/label_map.h"
#include "core/scene/mesh/surface_from_labels.h"

namespace adhesim {
namespace {

struct Ellipsoid {
  Vec3 centre, radii;
};

// Numbers of our own, in lengths of the organ along x: a thick right lobe with a tip that hangs
// down, a flat left lobe, a caudate lobe behind. The hollow is what the stomach and the gall
// bladder press into the underside.
constexpr double kBlend = 0.10;  // how widely lobes melt into each other
const std::array<Ellipsoid, 4>& Lobes() {
  static const std::array<Ellipsoid, 4> kLobes = {{{{-0.18, 0.02, 0.02}, {0.31, 0.34, 0.30}},
                                                   {{-0.26, 0.04, -0.22}, {0.17, 0.22, 0.24}},
                                                   {{0.20, 0.10, 0.10}, {0.31, 0.22, 0.14}},
                                                   {{-0.02, -0.16, 0.00}, {0.15, 0.12, 0.16}}}};
  return kLobes;
}
const Ellipsoid kHollow = {{0.12, -0.10, -0.34}, {0.30, 0.30, 0.30}};

// About the distance to an ellipsoid, negative inside; exact on its surface.
double Distance(const Ellipsoid& e, const Vec3& p) {
  return ((p - e.centre).cwiseQuotient(e.radii).norm() - 1) * e.radii.minCoeff();
}

// A minimum without a crease: a parabola where the two are closer than kBlend.
double SmoothMin(double a, double b) {
  const double closeness = std::max(kBlend - std::abs(a - b), 0.0) / kBlend;
  return std::min(a, b) - closeness * closeness * kBlend / 4;
}

bool IsInside(const Vec3& p) {
  double distance = Distance(Lobes()[0], p);
  for (std::size_t i = 1; i < Lobes().size(); ++i) {
    distance = SmoothMin(distance, Distance(Lobes()[i], p));
  }
  return -SmoothMin(-distance, Distance(kHollow, p)) < 0;
}

}  // namespace

absl::StatusOr<TriangleMesh> MakeOrgan(double length_m, int particles) {
  // The same way as a segmented organ: an image first.
  constexpr int kVoxels = 150;
  SolidMap map;
  map.size = {kVoxels, kVoxels, kVoxels};
  map.spacing_m = Vec3::Constant(1.2 / kVoxels);
  map.solid.reserve(static_cast<std::size_t>(kVoxels) * kVoxels * kVoxels);
  for (int z = 0; z < kVoxels; ++z) {
    for (int y = 0; y < kVoxels; ++y) {
      for (int x = 0; x < kVoxels; ++x) {
        map.solid.push_back(
            IsInside(Vec3(x + 0.5, y + 0.5, z + 0.5) * (1.2 / kVoxels) - Vec3::Constant(0.6)));
      }
    }
  }
  absl::StatusOr<TriangleMesh> mesh = SurfaceFromLabels(map, particles);
  if (!mesh.ok()) return mesh;
  Aabb box;
  for (const Vec3& v : mesh->vertices) box.Add(v);
  for (Vec3& v : mesh->vertices) v *= length_m / (box.max.x() - box.min.x());
  return mesh;
}

}  // namespace adhesim
