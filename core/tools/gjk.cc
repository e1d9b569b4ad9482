#include "core/tools/gjk.h"

#include <limits>

namespace adhesim {
namespace {

// Weights of the point of the affine hull of `count` points nearest to the origin; false when the
// points are flat.
bool AffineWeights(const std::array<const Vec3*, 4>& p, int count, std::array<double, 4>* weights) {
  const Vec3 to_origin = -*p[0];
  if (count == 1) {
    *weights = {1, 0, 0, 0};
    return true;
  }
  const Vec3 e1 = *p[1] - *p[0];
  if (count == 2) {
    const double length_sq = e1.squaredNorm();
    if (length_sq == 0) return false;
    const double w = e1.dot(to_origin) / length_sq;
    *weights = {1 - w, w, 0, 0};
    return true;
  }
  const Vec3 e2 = *p[2] - *p[0];
  const Vec3 normal = e1.cross(e2);
  if (count == 3) {
    const double area_sq = normal.squaredNorm();
    if (!(area_sq > 1e-28 * e1.squaredNorm() * e2.squaredNorm())) return false;
    const double w1 = to_origin.cross(e2).dot(normal) / area_sq;
    const double w2 = e1.cross(to_origin).dot(normal) / area_sq;
    *weights = {1 - w1 - w2, w1, w2, 0};
    return true;
  }
  const Vec3 e3 = *p[3] - *p[0];
  const double volume = normal.dot(e3);
  if (!(std::abs(volume) > 1e-14 * normal.norm() * e3.norm())) return false;
  const double w1 = to_origin.dot(e2.cross(e3)) / volume;
  const double w2 = e1.dot(to_origin.cross(e3)) / volume;
  const double w3 = normal.dot(to_origin) / volume;
  *weights = {1 - w1 - w2 - w3, w1, w2, w3};
  return true;
}

}  // namespace

void GjkSimplex::Reduce() {
  double least = std::numeric_limits<double>::infinity();
  int best_mask = 1;
  std::array<double, 4> best_weights{1, 0, 0, 0};
  // Every set of vertices, as a bit mask; small sets come first, so that a tie keeps fewer
  // vertices.
  for (int size = 1; size <= count; ++size) {
    for (int mask = 1; mask < (1 << count); ++mask) {
      if (__builtin_popcount(static_cast<unsigned>(mask)) != size) continue;
      std::array<const Vec3*, 4> p{};
      int n = 0;
      for (int i = 0; i < count; ++i) {
        if (mask & (1 << i)) p[n++] = &vertices[i].difference;
      }
      std::array<double, 4> w{};
      if (!AffineWeights(p, n, &w)) continue;
      Vec3 point = Vec3::Zero();
      bool inside = true;
      for (int i = 0; i < n; ++i) {
        inside = inside && w[i] >= 0;
        point += w[i] * *p[i];
      }
      // Four vertices around the origin: the sets overlap, whatever round-off is left in the point.
      if (inside && n == 4) point = Vec3::Zero();
      if (inside && point.squaredNorm() < least) {
        least = point.squaredNorm();
        best_mask = mask;
        best_weights = w;
        nearest = point;
      }
    }
  }
  int n = 0;
  for (int i = 0; i < 4; ++i) {
    if (i < count && (best_mask & (1 << i))) vertices[n++] = vertices[i];
  }
  count = n;
  weights = best_weights;
}

}  // namespace adhesim
