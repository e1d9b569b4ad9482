#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/scene/mesh/lattice.h"
#include "core/scene/mesh/winding_number.h"

namespace adhesim {

// The label of the tissue at a point; -1: none.
using LabelAt = std::function<std::int32_t(const Vec3&)>;

// A point is inside a surface where the size of the generalised winding number is above a half:
// whichever way the surface faces, and across holes.
inline bool IsInside(const WindingNumber& winding, const Vec3& point) {
  const double w = winding.At(point);
  return w > 0.5 || w < -0.5;
}

// A cell of a lattice that touches a surface or lies inside it, and its five tetrahedra.
struct FilledCell {
  std::int32_t cell = 0;
  std::uint8_t touched = 0;             // bit k: the surface touches tetrahedron k
  std::array<float, 5> fill{};          // part of each tetrahedron that is inside
  std::array<std::int32_t, 5> label{};  // the label of most of the samples inside; -1: none
};

// The cells that are not outside, ascending. Cells that the surface touches, and those beside a
// cell on the other side (across a hole), are sampled at n^3 points each, n from 8 down to 3 so
// that there are some 200,000 samples at most while n can be less; n is returned through
// `samples_along`.
std::vector<FilledCell> FillCells(const Lattice& lattice, const TriangleMesh& surface,
                                  const WindingNumber& winding, const LabelAt& label_at,
                                  int* samples_along);

}  // namespace adhesim
