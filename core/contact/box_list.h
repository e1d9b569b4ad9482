#pragma once

#include <array>
#include <cstdint>

#include "core/model/geometry.h"
#include "core/model/simd.h"

namespace adhesim {

// Boxes around what of one body is near another, each with its number. Of two bodies, everything on
// one side is looked for near everything on the other: with some dozens on each, all boxes are
// compared, a vector of them at once, in place of a walk down a tree for each.
class BoxList {
 public:
  // What is more than this belongs into a tree; 15 KB stay in the first cache.
  static constexpr int kMost = 256;

  void Clear() { count_ = 0; }
  // False, and the list is of no use: there is more than kMost.
  bool Push(std::int32_t number, const Aabb& box) {
    if (count_ == kMost) return false;
    number_[count_] = number;
    for (int k = 0; k < 3; ++k) {
      min_[k][count_] = box.min(k);
      max_[k][count_] = box.max(k);
    }
    ++count_;
    return true;
  }

  // Calls visit(number) for each whose box overlaps `box`, in the order in which they were pushed.
  template <typename Visit>
  void Query(Simd simd, const Aabb& box, const Visit& visit) {
    RunSimd(simd, [&](auto) { Mark(box); });
    for (int i = 0; i < count_; ++i) {
      if (hit_[i]) visit(number_[i]);
    }
  }

 private:
  void Mark(const Aabb& box) {
    const double x0 = box.min.x(), y0 = box.min.y(), z0 = box.min.z();
    const double x1 = box.max.x(), y1 = box.max.y(), z1 = box.max.z();
    const int count = count_;
    for (int i = 0; i < count; ++i) {
      const std::array<std::int64_t, 6> within = {min_[0][i] <= x1, x0 <= max_[0][i],
                                                  min_[1][i] <= y1, y0 <= max_[1][i],
                                                  min_[2][i] <= z1, z0 <= max_[2][i]};
      hit_[i] = within[0] & within[1] & within[2] & within[3] & within[4] & within[5];
    }
  }

  int count_ = 0;
  std::array<std::int32_t, kMost> number_;
  std::array<std::array<double, kMost>, 3> min_, max_;
  std::array<std::int64_t, kMost> hit_;  // as wide as a coordinate: compilers vectorise that
};

}  // namespace adhesim
