#include "core/scene/mesh/isosurface.h"

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

constexpr float kInside = 0.5f;

// The edges of Kuhn's subdivision that start at a cell: towards each non-zero corner of the unit
// cube. Bit 0 of the number is x, bit 1 y, bit 2 z.
constexpr int kFirstEdge = 1, kLastEdge = 7;

// The six tetrahedra of a cube: from corner 0 to corner 7, one axis after the other.
constexpr std::array<std::array<int, 4>, 6> kTetrahedra = {
    {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}}};

std::array<int, 3> Offset(int corner) { return {corner & 1, corner >> 1 & 1, corner >> 2 & 1}; }

// Share of voxel i in each cell along one axis: (cell, length of overlap / cell length).
struct Overlap {
  int first_cell = 0;
  std::vector<double> shares;
};

std::vector<Overlap> Overlaps(int voxels, double spacing_m, double cell_m) {
  std::vector<Overlap> overlaps(voxels);
  for (int i = 0; i < voxels; ++i) {
    // In cells; the first cell is the empty border.
    const double low = 1 + i * spacing_m / cell_m, high = 1 + (i + 1) * spacing_m / cell_m;
    overlaps[i].first_cell = static_cast<int>(low);
    for (int cell = static_cast<int>(low); cell < high; ++cell) {
      overlaps[i].shares.push_back(std::min(high, cell + 1.0) - std::max(low, double(cell)));
    }
  }
  return overlaps;
}

// Calls visit(index) for each neighbour along the edges of the tetrahedra, both ways.
template <typename Visit>
void ForEachNeighbour(const OccupancyGrid& grid, std::size_t cell, Visit visit) {
  const auto nx = static_cast<std::size_t>(grid.size[0]),
             ny = static_cast<std::size_t>(grid.size[1]);
  const int x = static_cast<int>(cell % nx), y = static_cast<int>(cell / nx % ny),
            z = static_cast<int>(cell / nx / ny);
  for (int edge = kFirstEdge; edge <= kLastEdge; ++edge) {
    const auto [dx, dy, dz] = Offset(edge);
    for (const int way : {1, -1}) {
      const int px = x + way * dx, py = y + way * dy, pz = z + way * dz;
      if (px < 0 || py < 0 || pz < 0 || px >= grid.size[0] || py >= grid.size[1] ||
          pz >= grid.size[2]) {
        continue;
      }
      visit(grid.Index(px, py, pz));
    }
  }
}

// Marks what is connected to a cell on the same side (inside or outside); returns the number of
// cells.
std::size_t Flood(const OccupancyGrid& grid, std::size_t seed, std::int32_t mark,
                  std::vector<std::int32_t>* marks) {
  const bool inside = grid.fraction[seed] >= kInside;
  std::vector<std::size_t> stack = {seed};
  (*marks)[seed] = mark;
  std::size_t count = 0;
  while (!stack.empty()) {
    const std::size_t cell = stack.back();
    stack.pop_back();
    ++count;
    ForEachNeighbour(grid, cell, [&](std::size_t other) {
      if ((*marks)[other] != 0 || (grid.fraction[other] >= kInside) != inside) return;
      (*marks)[other] = mark;
      stack.push_back(other);
    });
  }
  return count;
}

// Vertices on the lattice edges that the surface crosses.
class Marcher {
 public:
  explicit Marcher(const OccupancyGrid& grid) : grid_(grid) {}

  TriangleMesh Run() {
    MakeVertices();
    for (int z = 0; z + 1 < grid_.size[2]; ++z) {
      for (int y = 0; y + 1 < grid_.size[1]; ++y) {
        for (int x = 0; x + 1 < grid_.size[0]; ++x) MarchCube(x, y, z);
      }
    }
    return std::move(mesh_);
  }

 private:
  bool IsInside(std::size_t cell) const { return grid_.fraction[cell] >= kInside; }

  void MakeVertices() {
    for (int z = 0; z + 1 < grid_.size[2]; ++z) {
      for (int y = 0; y + 1 < grid_.size[1]; ++y) {
        for (int x = 0; x + 1 < grid_.size[0]; ++x) {
          const std::size_t from = grid_.Index(x, y, z);
          for (int edge = kFirstEdge; edge <= kLastEdge; ++edge) {
            const auto [dx, dy, dz] = Offset(edge);
            const std::size_t to = grid_.Index(x + dx, y + dy, z + dz);
            if (IsInside(from) == IsInside(to)) continue;
            // Where the fraction is a half, but not so near a cell's centre that triangles
            // collapse; smoothing follows.
            const double a = grid_.fraction[from], b = grid_.fraction[to];
            const double t = std::clamp((kInside - a) / (b - a), 0.15, 0.85);
            keys_.push_back(8 * from + edge);
            mesh_.vertices.push_back(grid_.cell_m * Vec3(x + t * dx, y + t * dy, z + t * dz));
          }
        }
      }
    }
  }

  void MarchCube(int x, int y, int z) {
    std::array<std::size_t, 8> cells;
    int inside_count = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const auto [dx, dy, dz] = Offset(corner);
      cells[corner] = grid_.Index(x + dx, y + dy, z + dz);
      inside_count += IsInside(cells[corner]);
    }
    if (inside_count == 0 || inside_count == 8) return;
    for (const std::array<int, 4>& tetrahedron : kTetrahedra) {
      std::array<int, 4> in, out;
      int ins = 0, outs = 0;
      for (const int corner : tetrahedron) {
        (IsInside(cells[corner]) ? in[ins++] : out[outs++]) = corner;
      }
      if (ins == 1) AddTriangle(cells, {{{in[0], out[0]}, {in[0], out[1]}, {in[0], out[2]}}});
      if (ins == 3) AddTriangle(cells, {{{in[0], out[0]}, {in[1], out[0]}, {in[2], out[0]}}});
      if (ins == 2) {
        AddTriangle(cells, {{{in[0], out[0]}, {in[0], out[1]}, {in[1], out[1]}}});
        AddTriangle(cells, {{{in[0], out[0]}, {in[1], out[1]}, {in[1], out[0]}}});
      }
    }
  }

  // A triangle between three lattice edges (inside corner, outside corner). Its winding follows
  // from the middles of the edges alone, so that it does not depend on rounding.
  void AddTriangle(const std::array<std::size_t, 8>& cells,
                   const std::array<std::array<int, 2>, 3>& edges) {
    Triangle triangle;
    std::array<Vec3, 3> middle;
    Vec3 outwards = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      const auto [in, out] = edges[k];
      const auto [ix, iy, iz] = Offset(in);
      const auto [ox, oy, oz] = Offset(out);
      middle[k] = Vec3(ix + ox, iy + oy, iz + oz);
      outwards += Vec3(ox - ix, oy - iy, oz - iz);
      // Along an edge one corner's bits contain the other's.
      const std::size_t key = 8 * cells[in & out] + (in ^ out);
      triangle[k] = static_cast<std::int32_t>(std::lower_bound(keys_.begin(), keys_.end(), key) -
                                              keys_.begin());
    }
    if ((middle[1] - middle[0]).cross(middle[2] - middle[0]).dot(outwards) < 0) {
      std::swap(triangle[1], triangle[2]);
    }
    mesh_.triangles.push_back(triangle);
  }

  const OccupancyGrid& grid_;
  TriangleMesh mesh_;
  std::vector<std::size_t> keys_;  // 8 * cell + edge of each vertex, ascending
};

}  // namespace

OccupancyGrid Average(const SolidMap& map, double cell_m) {
  OccupancyGrid grid;
  grid.cell_m = cell_m;
  std::array<std::vector<Overlap>, 3> overlaps;
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = map.size[axis] * map.spacing_m[axis] / cell_m;
    grid.size[axis] = static_cast<int>(std::ceil(extent)) + 3;  // borders, and one for rounding
    overlaps[axis] = Overlaps(map.size[axis], map.spacing_m[axis], cell_m);
  }
  grid.fraction.assign(grid.Index(0, 0, grid.size[2]), 0.0f);
  std::vector<double> row(grid.size[0]);  // one line of voxels, averaged along x
  for (int z = 0; z < map.size[2]; ++z) {
    for (int y = 0; y < map.size[1]; ++y) {
      const std::uint8_t* voxels =
          map.solid.data() + (static_cast<std::size_t>(z) * map.size[1] + y) * map.size[0];
      if (std::none_of(voxels, voxels + map.size[0], [](std::uint8_t v) { return v != 0; })) {
        continue;
      }
      std::fill(row.begin(), row.end(), 0.0);
      for (int x = 0; x < map.size[0]; ++x) {
        if (voxels[x] == 0) continue;
        const Overlap& along_x = overlaps[0][x];
        for (std::size_t k = 0; k < along_x.shares.size(); ++k) {
          row[along_x.first_cell + k] += along_x.shares[k];
        }
      }
      const Overlap &along_y = overlaps[1][y], &along_z = overlaps[2][z];
      for (std::size_t j = 0; j < along_z.shares.size(); ++j) {
        for (std::size_t k = 0; k < along_y.shares.size(); ++k) {
          float* cells =
              grid.fraction.data() + grid.Index(0, along_y.first_cell + static_cast<int>(k),
                                                along_z.first_cell + static_cast<int>(j));
          const double share = along_z.shares[j] * along_y.shares[k];
          for (int x = 0; x < grid.size[0]; ++x) cells[x] += static_cast<float>(share * row[x]);
        }
      }
    }
  }
  return grid;
}

void KeepLargestSolid(OccupancyGrid* grid) {
  std::vector<std::int32_t> marks(grid->fraction.size(), 0);
  constexpr std::int32_t kOutside = 1;
  Flood(*grid, 0, kOutside, &marks);  // the border is empty
  std::int32_t last = kOutside, largest = 0;
  std::size_t largest_count = 0;
  for (std::size_t cell = 0; cell < marks.size(); ++cell) {
    if (marks[cell] != 0 || grid->fraction[cell] < kInside) continue;
    const std::size_t count = Flood(*grid, cell, ++last, &marks);
    if (count > largest_count) {
      largest_count = count;
      largest = last;
    }
  }
  // Everything that the outside cannot reach without crossing the largest solid belongs to it.
  for (std::size_t cell = 0; cell < marks.size(); ++cell) {
    const bool other_solid = grid->fraction[cell] >= kInside && marks[cell] != largest;
    if (other_solid) grid->fraction[cell] = 0;
  }
  std::vector<std::int32_t> reached(grid->fraction.size(), 0);
  Flood(*grid, 0, kOutside, &reached);
  for (std::size_t cell = 0; cell < reached.size(); ++cell) {
    if (reached[cell] == 0 && grid->fraction[cell] < kInside) grid->fraction[cell] = 1;
  }
}

TriangleMesh MarchTetrahedra(const OccupancyGrid& grid) { return Marcher(grid).Run(); }

}  // namespace adhesim
