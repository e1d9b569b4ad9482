#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/model/geometry.h"
#include "core/scene/mesh/label_map.h"

namespace adhesim {

// How much of each cubic cell is solid, on a lattice whose outermost cells are empty.
struct OccupancyGrid {
  std::array<int, 3> size{};
  double cell_m = 0;
  std::vector<float> fraction;  // [z][y][x] in [0, 1]

  std::size_t Index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * size[1] + y) * size[0] + x;
  }
};

// Averages an image into cubic cells (any ratio of cell to voxel), with an empty border.
OccupancyGrid Average(const SolidMap& map, double cell_m);

// Cells with a fraction of at least a half are inside. Keeps the largest connected set of inside
// cells, and fills the cavities that it encloses (a body has one surface). Cells are neighbours
// along the edges of the tetrahedra below.
void KeepLargestSolid(OccupancyGrid* grid);

// The surface between inside and outside by marching tetrahedra (six per cube around its main
// diagonal, Kuhn's subdivision, which is the same on both sides of every cube face): always closed,
// manifold and outward-oriented.
TriangleMesh MarchTetrahedra(const OccupancyGrid& grid);

}  // namespace adhesim
