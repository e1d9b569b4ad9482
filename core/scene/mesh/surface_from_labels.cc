#include "core/scene/mesh/surface_from_labels.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/scene/mesh/isosurface.h"
#include "core/scene/mesh/simplify.h"
#include "core/scene/mesh/topology.h"

namespace adhesim {
namespace {

// Only the part of the image with labels: most of a CT is empty.
SolidMap Cropped(const SolidMap& map, Vec3* corner_m) {
  std::array<int, 3> low = map.size, high = {-1, -1, -1};
  std::size_t i = 0;
  for (int z = 0; z < map.size[2]; ++z) {
    for (int y = 0; y < map.size[1]; ++y) {
      const std::uint8_t* row = map.solid.data() + i;
      const std::uint8_t* end = row + map.size[0];
      i += static_cast<std::size_t>(map.size[0]);
      const std::uint8_t* first = std::find_if(row, end, [](std::uint8_t v) { return v != 0; });
      if (first == end) continue;
      const std::uint8_t* last = end - 1;
      while (*last == 0) --last;
      low = {std::min(low[0], int(first - row)), std::min(low[1], y), std::min(low[2], z)};
      high = {std::max(high[0], int(last - row)), std::max(high[1], y), std::max(high[2], z)};
    }
  }
  SolidMap cropped{{}, map.spacing_m, {}, {}};
  if (high[2] < 0) return cropped;
  *corner_m = Vec3(low[0], low[1], low[2]).cwiseProduct(map.spacing_m);
  for (int axis = 0; axis < 3; ++axis) cropped.size[axis] = high[axis] - low[axis] + 1;
  for (int z = low[2]; z <= high[2]; ++z) {
    for (int y = low[1]; y <= high[1]; ++y) {
      const auto row =
          map.solid.begin() + (static_cast<std::ptrdiff_t>(z) * map.size[1] + y) * map.size[0];
      cropped.solid.insert(cropped.solid.end(), row + low[0], row + high[0] + 1);
    }
  }
  return cropped;
}

// Area of the solid's surface, from the exposed faces of voxels: over all directions these
// overestimate by 3/2.
double EstimateArea(const SolidMap& map) {
  const std::array<std::size_t, 3> stride = {1, static_cast<std::size_t>(map.size[0]),
                                             static_cast<std::size_t>(map.size[0]) * map.size[1]};
  std::array<std::int64_t, 3> faces{};
  std::size_t i = 0;
  for (int z = 0; z < map.size[2]; ++z) {
    for (int y = 0; y < map.size[1]; ++y) {
      for (int x = 0; x < map.size[0]; ++x, ++i) {
        if (map.solid[i] == 0) continue;
        const std::array<int, 3> at = {x, y, z};
        for (int axis = 0; axis < 3; ++axis) {
          faces[axis] += at[axis] == 0 || map.solid[i - stride[axis]] == 0;
          faces[axis] += at[axis] + 1 == map.size[axis] || map.solid[i + stride[axis]] == 0;
        }
      }
    }
  }
  const Vec3& s = map.spacing_m;
  return (faces[0] * s.y() * s.z() + faces[1] * s.z() * s.x() + faces[2] * s.x() * s.y()) / 1.5;
}

double SolidVolume(const OccupancyGrid& grid) {
  const double cells = std::accumulate(grid.fraction.begin(), grid.fraction.end(), 0.0);
  return cells * grid.cell_m * grid.cell_m * grid.cell_m;
}

// The positive third root by Newton's method: libm's may differ between machines.
double CubeRoot(double value) {
  double root = std::max(value, 1.0);
  for (int i = 0; i < 200; ++i) root = (2 * root + value / (root * root)) / 3;
  return root;
}

// Moves the centre of volume to the origin and scales the enclosed volume to `volume_m3`. Returns
// where the points were before.
PlaceInImage CentreAndScale(double volume_m3, TriangleMesh* mesh) {
  const Vec3 origin = mesh->vertices[0];
  Vec3 moment = Vec3::Zero();
  double six_volumes = 0;
  for (const auto [ia, ib, ic] : mesh->triangles) {
    const Vec3 a = mesh->vertices[ia] - origin, b = mesh->vertices[ib] - origin,
               c = mesh->vertices[ic] - origin;
    const double six_volume = a.dot(b.cross(c));
    six_volumes += six_volume;
    moment += six_volume * (a + b + c) / 4;  // a tetrahedron's centre is the mean of its corners
  }
  const Vec3 centre = origin + moment / six_volumes;
  const double scale = CubeRoot(volume_m3 / (six_volumes / 6));
  for (Vec3& v : mesh->vertices) v = scale * (v - centre);
  return {centre, scale};
}

}  // namespace

absl::StatusOr<TriangleMesh> SurfaceFromLabels(const SolidMap& map, int particles,
                                               PlaceInImage* place) {
  Vec3 corner_m = Vec3::Zero();
  const SolidMap solid = Cropped(map, &corner_m);
  if (solid.solid.empty()) return absl::InvalidArgumentError("the image has no labels");
  // Several times the vertices wanted, so that collapsing has a choice, and enough of them to see
  // the shape at all. Marching tetrahedra make about 4.5 vertices per cell face: the mean of
  // |direction . normal| is 1/2 over three edges of length 1, three of sqrt 2 and one of sqrt 3 at
  // each cell.
  constexpr double kVerticesPerCellArea = 4.5;
  constexpr std::int64_t kMostCells = 64'000'000;
  const double wanted = std::max(5.0 * particles, 4000.0);
  double cell_m = std::sqrt(kVerticesPerCellArea * EstimateArea(solid) / wanted);
  for (int attempt = 0; attempt < 4; ++attempt, cell_m *= 0.7) {
    const Vec3 extent =
        (solid.spacing_m.array() * Vec3(solid.size[0], solid.size[1], solid.size[2]).array()) /
            cell_m +
        4;
    if (!(extent.prod() < kMostCells)) break;
    OccupancyGrid grid = Average(solid, cell_m);
    KeepLargestSolid(&grid);
    TriangleMesh mesh = MarchTetrahedra(grid);
    if (static_cast<int>(mesh.vertices.size()) < 2 * particles) continue;  // thin parts were lost
    SmoothTaubin(12, &mesh);
    const int left = CollapseEdges(particles, &mesh);
    if (left * 50 > particles * 51) continue;
    EvenTriangles(8, &mesh);
    if (!(EnclosedVolume(mesh) > 0)) continue;
    PlaceInImage in_grid = CentreAndScale(SolidVolume(grid), &mesh);
    // In the grid the middle of the first cell is the origin, and that cell is an empty border.
    in_grid.origin_m += corner_m - Vec3::Constant(0.5 * cell_m);
    if (place != nullptr) *place = in_grid;
    return mesh;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("no even surface of ", particles,
                   " vertices fits around this solid; ask for another number"));
}

}  // namespace adhesim
