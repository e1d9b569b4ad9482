#pragma once

#include <absl/status/statusor.h>

#include <array>

#include "core/scene/mesh/tet_mesh.h"

namespace adhesim {

// A cell is cut into five tetrahedra: one at each of four corners that share no edge, and one
// between. Which four alternates like the fields of a chessboard, so that the diagonals of a face
// are the same in both cells that share it: they join the lattice points whose coordinates have an
// even sum. Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2 & 1).
inline constexpr int kCellTetrahedra[2][5][4] = {
    {{0, 5, 3, 6}, {1, 0, 5, 3}, {2, 3, 6, 0}, {4, 5, 0, 6}, {7, 6, 3, 5}},   // even cells
    {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}}};  // odd cells
inline const auto& CellTetrahedra(int x, int y, int z) { return kCellTetrahedra[(x + y + z) & 1]; }

// Cells along each axis: `cells` along the longest, the others as near to cubes as they can be, at
// least one.
std::array<int, 3> CellsAlong(const Vec3& size_m, int cells);

// A box centred on its origin, cut exactly. Errors: more nodes than kMaxParticles.
absl::StatusOr<TetMesh> MakeTetBlock(const Vec3& size_m, int cells);

}  // namespace adhesim
