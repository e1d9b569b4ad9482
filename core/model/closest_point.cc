#include "core/model/closest_point.h"

#include <algorithm>
#include <array>

namespace adhesim {

namespace {

// The nearest point of the three edges: all that a triangle without area has.
ClosestPoint ClosestPointOnEdges(const Vec3& p, const std::array<Vec3, 3>& corner) {
  ClosestPoint best{Vec3(1, 0, 0), ClosestPoint::kCorner0, (p - corner[0]).squaredNorm()};
  for (int k = 0; k < 3; ++k) {
    const Vec3& a = corner[k];
    const Vec3 along = corner[(k + 1) % 3] - a;
    const double length_sq = along.squaredNorm();
    const double t = length_sq > 0 ? std::clamp((p - a).dot(along) / length_sq, 0.0, 1.0) : 0;
    const double distance_sq = (p - a - t * along).squaredNorm();
    if (distance_sq >= best.distance_sq_m2) continue;
    best.weights.setZero();
    best.weights(k) = 1 - t;
    best.weights((k + 1) % 3) = t;
    best.feature = static_cast<ClosestPoint::Feature>(ClosestPoint::kEdge0 + k);
    best.distance_sq_m2 = distance_sq;
  }
  return best;
}

constexpr double kFlat = 1e-24;  // squared sine of an angle below which a triangle counts as a line

}  // namespace

ClosestPoint ClosestPointOnTriangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const auto at = [&](double wa, double wb, double wc, ClosestPoint::Feature feature) {
    const Vec3 nearest = wa * ap + wb * bp + wc * cp;  // p - nearest point
    return ClosestPoint{Vec3(wa, wb, wc), feature, nearest.squaredNorm()};
  };
  if (!(ab.cross(ac).squaredNorm() > kFlat * ab.squaredNorm() * ac.squaredNorm())) {
    return ClosestPointOnEdges(p, {a, b, c});
  }
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return at(1, 0, 0, ClosestPoint::kCorner0);
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return at(0, 1, 0, ClosestPoint::kCorner1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double t = d1 / (d1 - d3);
    return at(1 - t, t, 0, ClosestPoint::kEdge0);
  }
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return at(0, 0, 1, ClosestPoint::kCorner2);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double t = d2 / (d2 - d6);
    return at(1 - t, 0, t, ClosestPoint::kEdge2);
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return at(0, 1 - t, t, ClosestPoint::kEdge1);
  }
  const double sum = va + vb + vc;
  return at(va / sum, vb / sum, vc / sum, ClosestPoint::kFace);
}

}  // namespace adhesim
