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
  const Lattice lattice{n};
  mesh.surface.vertices.reserve(nodes);
  for (int z = 0; z <= n[2]; ++z) {
    for (int y = 0; y <= n[1]; ++y) {
      for (int x = 0; x <= n[0]; ++x) {
        mesh.surface.vertices.emplace_back(size_m.x() * (static_cast<double>(x) / n[0] - 0.5),
                                           size_m.y() * (static_cast<double>(y) / n[1] - 0.5),
                                           size_m.z() * (static_cast<double>(z) / n[2] - 0.5));
      }
    }
  }
  for (std::int32_t cell = 0; cell < lattice.cell_count(); ++cell) {
    for (const auto& corners : CellTetrahedra(lattice.CellAt(cell))) {
      Tetrahedron& tetrahedron = mesh.tetrahedra.emplace_back();
      for (int k = 0; k < 4; ++k) tetrahedron[k] = lattice.Corner(cell, corners[k]);
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
