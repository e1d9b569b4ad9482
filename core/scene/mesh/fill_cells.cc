#include "core/scene/mesh/fill_cells.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/scene/mesh/topology.h"

namespace adhesim {
namespace {

constexpr std::int64_t kMostSamples = 200'000;
constexpr int kMostAlong = 8, kLeastAlong = 3;

// Whether two convex sets of points are apart along an axis.
bool Apart(const Vec3& axis, std::span<const Vec3> a, std::span<const Vec3> b) {
  double a_min = axis.dot(a[0]), a_max = a_min, b_min = axis.dot(b[0]), b_max = b_min;
  for (const Vec3& p : a.subspan(1)) {
    a_min = std::min(a_min, axis.dot(p));
    a_max = std::max(a_max, axis.dot(p));
  }
  for (const Vec3& p : b.subspan(1)) {
    b_min = std::min(b_min, axis.dot(p));
    b_max = std::max(b_max, axis.dot(p));
  }
  return a_max < b_min || b_max < a_min;
}

// Separating axes: the normals of all faces and the cross products of all edges.
bool Touch(const std::array<Vec3, 3>& triangle, const std::array<Vec3, 4>& tetrahedron) {
  const std::array<Vec3, 3> side = {triangle[1] - triangle[0], triangle[2] - triangle[1],
                                    triangle[0] - triangle[2]};
  const auto apart = [&](const Vec3& axis) { return Apart(axis, triangle, tetrahedron); };
  if (apart(side[0].cross(side[1]))) return false;
  for (const auto& face : kTetFaces) {
    const Vec3& a = tetrahedron[face[0]];
    if (apart((tetrahedron[face[1]] - a).cross(tetrahedron[face[2]] - a))) return false;
  }
  for (int i = 0; i < 4; ++i) {
    for (int j = i + 1; j < 4; ++j) {
      const Vec3 edge = tetrahedron[j] - tetrahedron[i];
      for (const Vec3& s : side) {
        if (apart(edge.cross(s))) return false;
      }
    }
  }
  return true;
}

// What a cell's samples belong to: each of n^3 points, x fastest, lies in one of the five
// tetrahedra: at a corner when the distances along the axes sum to less than an edge.
std::vector<std::uint8_t> TetrahedronOfSample(int n, bool odd) {
  std::vector<std::uint8_t> tetrahedron;
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        std::uint8_t found = 0;
        for (int k = 1; k < 5; ++k) {
          const int c = kCellTetrahedra[odd][k][0];
          const int dx = c & 1 ? n - 1 - x : x, dy = c >> 1 & 1 ? n - 1 - y : y,
                    dz = c >> 2 & 1 ? n - 1 - z : z;
          if (dx + dy + dz + 1.5 < n) found = static_cast<std::uint8_t>(k);
        }
        tetrahedron.push_back(found);
      }
    }
  }
  return tetrahedron;
}

enum Side : std::uint8_t { kUnknown, kOutside, kWithin, kMixed };

class Filler {
 public:
  Filler(const Lattice& lattice, const TriangleMesh& surface, const WindingNumber& winding,
         const LabelAt& label_at)
      : lattice_(lattice),
        surface_(surface),
        winding_(winding),
        label_at_(label_at),
        touched_(lattice.cell_count(), 0),
        side_(lattice.cell_count(), kUnknown) {}

  std::vector<FilledCell> Run(int* samples_along) {
    for (const Triangle& triangle : surface_.triangles) MarkTouched(triangle);
    for (std::size_t c = 0; c < side_.size(); ++c) {
      if (touched_[c]) side_[c] = kMixed;
    }
    FindSides();
    const std::int64_t mixed = std::count(side_.begin(), side_.end(), kMixed);
    along_ = kMostAlong;
    while (along_ > kLeastAlong && mixed * along_ * along_ * along_ > kMostSamples) --along_;
    *samples_along = along_;
    tetrahedron_of_sample_ = {TetrahedronOfSample(along_, false),
                              TetrahedronOfSample(along_, true)};
    std::vector<FilledCell> cells;
    for (std::int32_t cell = 0; cell < lattice_.cell_count(); ++cell) {
      if (side_[cell] == kWithin || side_[cell] == kMixed) cells.push_back(Sample(cell));
    }
    return cells;
  }

 private:
  Vec3 CentreOf(std::int32_t cell) const {
    const auto [x, y, z] = lattice_.CellAt(cell);
    return lattice_.origin + lattice_.cell_m * Vec3(x + 0.5, y + 0.5, z + 0.5);
  }

  void MarkTouched(const Triangle& triangle) {
    std::array<Vec3, 3> corner;  // in cells
    Aabb box;
    for (int k = 0; k < 3; ++k) {
      corner[k] = (surface_.vertices[triangle[k]] - lattice_.origin) / lattice_.cell_m;
      box.Add(corner[k]);
    }
    const Vec3 normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
    std::array<int, 3> low, high;
    for (int axis = 0; axis < 3; ++axis) {
      const int last = lattice_.size[axis] - 1;
      low[axis] = std::clamp(static_cast<int>(std::floor(box.min[axis])), 0, last);
      high[axis] = std::clamp(static_cast<int>(std::floor(box.max[axis])), 0, last);
    }
    for (int z = low[2]; z <= high[2]; ++z) {
      for (int y = low[1]; y <= high[1]; ++y) {
        for (int x = low[0]; x <= high[0]; ++x) {
          const Vec3 to_centre = Vec3(x + 0.5, y + 0.5, z + 0.5) - corner[0];
          if (std::abs(normal.dot(to_centre)) > 0.5 * normal.cwiseAbs().sum()) continue;
          MarkTetrahedra({x, y, z}, corner);
        }
      }
    }
  }

  void MarkTetrahedra(const std::array<int, 3>& at, const std::array<Vec3, 3>& triangle) {
    const std::int32_t cell = lattice_.Cell(at[0], at[1], at[2]);
    for (int k = 0; k < 5; ++k) {
      if (touched_[cell] >> k & 1) continue;
      std::array<Vec3, 4> tetrahedron;
      for (int i = 0; i < 4; ++i) {
        const int c = CellTetrahedra(at)[k][i];
        tetrahedron[i] = Vec3(at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2 & 1));
      }
      if (Touch(triangle, tetrahedron)) touched_[cell] |= 1 << k;
    }
  }

  template <typename Visit>
  void ForEachNeighbour(std::int32_t cell, Visit visit) const {
    const std::array<int, 3> at = lattice_.CellAt(cell);
    const std::array<std::int32_t, 3> stride = {1, lattice_.size[0],
                                                lattice_.size[0] * lattice_.size[1]};
    for (int axis = 0; axis < 3; ++axis) {
      if (at[axis] > 0) visit(cell - stride[axis]);
      if (at[axis] + 1 < lattice_.size[axis]) visit(cell + stride[axis]);
    }
  }

  // Every edge has as many triangles one way as the other: the winding number is a whole number
  // that changes at the surface only, so that one point tells for all that is connected to it.
  bool IsSealed() const {
    const std::vector<TriangleSide> sides = SortedSides(surface_.triangles);
    bool sealed = true;
    ForEachEdge(sides, [&](std::span<const TriangleSide> edge) {
      const auto ascending = std::count_if(edge.begin(), edge.end(),
                                           [](const TriangleSide& s) { return s.ascending; });
      sealed = sealed && 2 * ascending == static_cast<std::ptrdiff_t>(edge.size());
    });
    return sealed;
  }

  // Sides of the cells that the surface does not touch.
  void FindSides() {
    const bool sealed = IsSealed();
    std::vector<std::int32_t> stack;
    for (std::int32_t start = 0; start < lattice_.cell_count(); ++start) {
      if (side_[start] != kUnknown) continue;
      const Side side = IsInside(winding_, CentreOf(start)) ? kWithin : kOutside;
      side_[start] = side;
      if (!sealed) continue;
      stack = {start};
      while (!stack.empty()) {
        const std::int32_t cell = stack.back();
        stack.pop_back();
        ForEachNeighbour(cell, [&](std::int32_t other) {
          if (side_[other] != kUnknown) return;
          side_[other] = side;
          stack.push_back(other);
        });
      }
    }
    if (sealed) return;
    std::vector<std::int32_t> mixed;
    for (std::int32_t cell = 0; cell < lattice_.cell_count(); ++cell) {
      if (side_[cell] == kMixed) continue;
      bool beside = false;
      ForEachNeighbour(cell, [&](std::int32_t other) {
        beside = beside || (side_[other] != kMixed && side_[other] != side_[cell]);
      });
      if (beside) mixed.push_back(cell);
    }
    for (const std::int32_t cell : mixed) side_[cell] = kMixed;
  }

  FilledCell Sample(std::int32_t cell) {
    FilledCell filled;
    filled.cell = cell;
    filled.touched = touched_[cell];
    filled.fill.fill(1);
    filled.label.fill(-1);
    if (side_[cell] == kWithin && !label_at_) return filled;
    const auto [x, y, z] = lattice_.CellAt(cell);
    const std::vector<std::uint8_t>& tetrahedron_of = tetrahedron_of_sample_[(x + y + z) & 1];
    std::array<int, 5> all{}, inside{};
    std::array<std::vector<std::int32_t>, 5> labels;
    for (std::size_t s = 0; s < tetrahedron_of.size(); ++s) {
      const int i = static_cast<int>(s), k = tetrahedron_of[s];
      const auto [a, b, c] = Lattice::Split(i, along_, along_);
      const Vec3 in_cells = Vec3(x, y, z) + Vec3(a + 0.5, b + 0.5, c + 0.5) / along_;
      const Vec3 point = lattice_.origin + lattice_.cell_m * in_cells;
      ++all[k];
      if (side_[cell] == kMixed && !IsInside(winding_, point)) continue;
      ++inside[k];
      if (!label_at_) continue;
      if (const std::int32_t label = label_at_(point); label >= 0) labels[k].push_back(label);
    }
    for (int k = 0; k < 5; ++k) {
      filled.fill[k] = static_cast<float>(inside[k]) / static_cast<float>(all[k]);
      filled.label[k] = MostFrequent(&labels[k]);
    }
    return filled;
  }

  // The smallest of the most frequent numbers; -1 of none.
  static std::int32_t MostFrequent(std::vector<std::int32_t>* numbers) {
    std::sort(numbers->begin(), numbers->end());
    std::int32_t best = -1;
    std::ptrdiff_t best_count = 0;
    for (auto first = numbers->begin(); first != numbers->end();) {
      const auto last = std::upper_bound(first, numbers->end(), *first);
      if (last - first > best_count) {
        best = *first;
        best_count = last - first;
      }
      first = last;
    }
    return best;
  }

  const Lattice& lattice_;
  const TriangleMesh& surface_;
  const WindingNumber& winding_;
  const LabelAt& label_at_;
  std::vector<std::uint8_t> touched_;  // [#cells] bit k: tetrahedron k
  std::vector<std::uint8_t> side_;     // [#cells] Side
  int along_ = kMostAlong;
  std::array<std::vector<std::uint8_t>, 2> tetrahedron_of_sample_;  // of even and odd cells
};

}  // namespace

std::vector<FilledCell> FillCells(const Lattice& lattice, const TriangleMesh& surface,
                                  const WindingNumber& winding, const LabelAt& label_at,
                                  int* samples_along) {
  return Filler(lattice, surface, winding, label_at).Run(samples_along);
}

}  // namespace adhesim
