#include "core/contact/closest_point.h"

namespace adhesim {

ClosestPoint ClosestPointOnTriangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const auto at = [&](double wa, double wb, double wc, ClosestPoint::Feature feature) {
    const Vec3 nearest = wa * ap + wb * bp + wc * cp;  // p - nearest point
    return ClosestPoint{Vec3(wa, wb, wc), feature, nearest.squaredNorm()};
  };
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
  if (!(sum > 0)) return at(1, 0, 0, ClosestPoint::kCorner0);
  return at(va / sum, vb / sum, vc / sum, ClosestPoint::kFace);
}

}  // namespace adhesim
