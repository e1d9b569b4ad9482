#include "core/scene/mesh/lattice.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace adhesim {

std::array<int, 3> CellsAlong(const Vec3& size_m, int cells) {
  std::array<int, 3> n;
  for (int axis = 0; axis < 3; ++axis) {
    const double share = cells * (size_m[axis] / size_m.maxCoeff());
    n[axis] = std::max(1, static_cast<int>(std::lround(share)));
  }
  return n;
}

absl::StatusOr<TetMesh> MakeTetBlock(const Vec3& size_m, int cells) {
  const std::array<int, 3> n = CellsAlong(size_m, cells);
  const std::int64_t nodes = (n[0] + 1LL) * (n[1] + 1LL) * (n[2] + 1LL);
  if (nodes > kMaxParticles) {
    return absl::InvalidArgumentError(absl::StrCat(
        cells, " cells along the longest edge make a lattice of ", n[0], " x ", n[1], " x ", n[2],
        " cells with ", nodes, " nodes; at most ", kMaxParticles, " are permitted"));
  }
  TetMesh mesh;
  std::vector<Vec3>& points = mesh.surface.vertices;
  points.reserve(nodes);
  for (int z = 0; z <= n[2]; ++z) {
    for (int y = 0; y <= n[1]; ++y) {
      for (int x = 0; x <= n[0]; ++x) {
        points.emplace_back(size_m.x() * (static_cast<double>(x) / n[0] - 0.5),
                            size_m.y() * (static_cast<double>(y) / n[1] - 0.5),
                            size_m.z() * (static_cast<double>(z) / n[2] - 0.5));
      }
    }
  }
  const auto node = [&](int x, int y, int z) { return (z * (n[1] + 1) + y) * (n[0] + 1) + x; };
  for (int z = 0; z < n[2]; ++z) {
    for (int y = 0; y < n[1]; ++y) {
      for (int x = 0; x < n[0]; ++x) {
        for (const auto& corners : CellTetrahedra(x, y, z)) {
          Tetrahedron& tetrahedron = mesh.tetrahedra.emplace_back();
          for (int k = 0; k < 4; ++k) {
            const int c = corners[k];
            tetrahedron[k] = node(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2 & 1));
          }
        }
      }
    }
  }
  mesh.fill.assign(mesh.tetrahedra.size(), 1);
  mesh.label.assign(mesh.tetrahedra.size(), -1);
  mesh.group.assign(mesh.tetrahedra.size(), -1);
  mesh.surface.triangles = BoundaryTriangles(mesh.tetrahedra);
  PutSurfaceFirst(&mesh);
  return mesh;
}

}  // namespace adhesim
