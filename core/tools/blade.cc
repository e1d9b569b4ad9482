#include <algorithm>

#include "core/tools/gjk.h"
#include "core/tools/nearest.h"

namespace adhesim {
namespace {

// A convex part of a triangle, its corners in barycentric coordinates of the triangle.
struct Polygon {
  static constexpr int kMaxCorners = 3 + Blade::kPlaneCount;  // each cut adds one at most
  Polygon() { corners.fill(Vec3::Zero()); }
  std::array<Vec3, kMaxCorners> corners;
  int count = 0;
};

// Height of the triangle's corners above each plane.
using Heights = std::array<Vec3, Blade::kPlaneCount>;

Polygon Clip(const Polygon& polygon, const Vec3& height, double level) {
  Polygon kept;
  for (int i = 0; i < polygon.count; ++i) {
    const Vec3& a = polygon.corners[i];
    const Vec3& b = polygon.corners[(i + 1) % polygon.count];
    const double ha = height.dot(a) - level, hb = height.dot(b) - level;
    if (ha <= 0) kept.corners[kept.count++] = a;
    if (((ha < 0 && hb > 0) || (ha > 0 && hb < 0)) && kept.count < Polygon::kMaxCorners) {
      kept.corners[kept.count++] = a + ha / (ha - hb) * (b - a);
    }
    if (kept.count == Polygon::kMaxCorners) break;
  }
  return kept;
}

// The centre of the part of the triangle that is no higher than `level` above any plane; false when
// there is none.
bool CentreBelow(const Heights& heights, double level, Vec3* weights) {
  Polygon part;
  for (int k = 0; k < 3; ++k) part.corners[k] = Vec3::Unit(k);
  part.count = 3;
  for (const Vec3& height : heights) {
    part = Clip(part, height, level);
    if (part.count == 0) return false;
  }
  *weights = Vec3::Zero();
  for (int i = 0; i < part.count; ++i) *weights += part.corners[i] / part.count;
  return true;
}

int HighestPlane(const Heights& heights, const Vec3& weights) {
  int best = 0;
  for (int i = 1; i < Blade::kPlaneCount; ++i) {
    if (heights[i].dot(weights) > heights[best].dot(weights)) best = i;
  }
  return best;
}

// The deepest point of a triangle that reaches into the blade: least over the triangle of the
// greatest height above the planes, by bisection over the level.
void DeepestPoint(const Blade& blade, const TriangleCorners& corners, SolidNearest* nearest) {
  Heights heights;
  double low = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < Blade::kPlaneCount; ++i) {
    for (int k = 0; k < 3; ++k)
      heights[i][k] = blade.planes[i].normal.dot(corners[k]) - blade.planes[i].offset;
    low = std::max(low, heights[i].minCoeff());
  }
  Vec3 weights = Vec3::Constant(1.0 / 3);
  double high = heights[HighestPlane(heights, weights)].dot(weights);
  for (int k = 0; k < 3; ++k) {
    const Vec3 corner = Vec3::Unit(k);
    const double value = heights[HighestPlane(heights, corner)].dot(corner);
    if (value < high) {
      high = value;
      weights = corner;
    }
  }
  constexpr double kTolerance_m = 1e-12;
  for (int round = 0; round < 60 && high - low > kTolerance_m; ++round) {
    const double middle = 0.5 * (low + high);
    Vec3 centre;
    if (CentreBelow(heights, middle, &centre)) {
      high = middle;
      weights = centre;
    } else {
      low = middle;
    }
  }
  const int plane = HighestPlane(heights, weights);
  nearest->weights = weights;
  nearest->distance_m = heights[plane].dot(weights);
  nearest->normal = ContactNormal(corners, weights, blade.planes[plane].normal);
}

}  // namespace

bool NearestToBlade(const Blade& blade, const TriangleCorners& corners, double within_m,
                    SolidNearest* nearest) {
  const auto support_blade = [&](const Vec3& d) { return SupportPoint(blade, d); };
  const auto support_triangle = [&](const Vec3& d) {
    int best = 0;
    for (int k = 1; k < 3; ++k) {
      if (corners[k].dot(d) > corners[best].dot(d)) best = k;
    }
    return SupportOfB{corners[best], best};
  };
  const GjkResult gjk = Gjk(support_blade, support_triangle);
  const double distance = gjk.from_a_to_b.norm();
  // Below this the direction between the nearest points is round-off.
  constexpr double kTouching = 1e-12;
  if (gjk.overlap || distance < kTouching) {
    DeepestPoint(blade, corners, nearest);
  } else {
    nearest->distance_m = distance;
    nearest->weights = Vec3::Zero();
    for (int i = 0; i < gjk.simplex.count; ++i) {
      nearest->weights[gjk.simplex.vertices[i].corner] += gjk.simplex.weights[i];
    }
    nearest->normal = gjk.from_a_to_b / distance;
  }
  nearest->point_m = nearest->weights[0] * corners[0] + nearest->weights[1] * corners[1] +
                     nearest->weights[2] * corners[2];
  return nearest->distance_m <= within_m;
}

}  // namespace adhesim
