#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>

#include "core/scene/mesh/tet_mesh.h"

namespace adhesim {

// A cell is cut into five tetrahedra: one at each of four corners that share no edge, and one
// between. Which four alternates like the fields of a chessboard, so that the diagonals of a face
// are the same in both cells that share it: they join the lattice points whose coordinates have an
// even sum. Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2 & 1).
inline constexpr int kCellTetrahedra[2][5][4] = {
    {{0, 5, 3, 6}, {1, 0, 5, 3}, {2, 3, 6, 0}, {4, 5, 0, 6}, {7, 6, 3, 5}},   // even cells
    {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}}};  // odd cells
inline const auto& CellTetrahedra(const std::array<int, 3>& at) {
  return kCellTetrahedra[(at[0] + at[1] + at[2]) & 1];
}

// A regular lattice of cubes.
struct Lattice {
  std::array<int, 3> size{};  // cells along each axis
  Vec3 origin = Vec3::Zero();
  double cell_m = 0;

  std::int32_t cell_count() const { return size[0] * size[1] * size[2]; }
  std::int32_t Cell(int x, int y, int z) const { return (z * size[1] + y) * size[0] + x; }
  std::array<int, 3> CellAt(std::int32_t cell) const { return Split(cell, size[0], size[1]); }
  // A number of which x runs fastest, y next.
  static std::array<int, 3> Split(std::int32_t number, int nx, int ny) {
    return {number % nx, number / nx % ny, number / nx / ny};
  }
  // Nodes are numbered like the cells of a lattice that is one larger.
  std::int32_t node_count() const { return (size[0] + 1) * (size[1] + 1) * (size[2] + 1); }
  std::int32_t Node(int x, int y, int z) const {
    return (z * (size[1] + 1) + y) * (size[0] + 1) + x;
  }
  std::int32_t Corner(std::int32_t cell, int corner) const {
    const auto [x, y, z] = CellAt(cell);
    return Node(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2 & 1));
  }
  Vec3 NodePosition(std::int32_t node) const {
    const auto [x, y, z] = Split(node, size[0] + 1, size[1] + 1);
    return origin + cell_m * Vec3(x, y, z);
  }
};

// Cells along each axis: `cells` along the longest, the others as near to cubes as they can be, at
// least one.
std::array<int, 3> CellsAlong(const Vec3& size_m, int cells);

// A box centred on its origin, cut exactly. Errors: more nodes than kMaxParticles.
absl::StatusOr<TetMesh> MakeTetBlock(const Vec3& size_m, int cells);

}  // namespace adhesim
