#include "core/contact/penetration.h"

#include <algorithm>
#include <cmath>

#include "core/contact/closest_point.h"

namespace adhesim {
namespace {

// Solid angle of the body's surface seen from p, over 4 pi: 1 inside, 0 outside (van Oosterom and
// Strackee 1983).
double WindingNumber(const Model& model, const Body& body, std::span<const Vec3> position_m,
                     const Vec3& p) {
  double solid_angle = 0;
  for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
    const Triangle& tri = model.triangles[t];
    const Vec3 a = position_m[tri[0]] - p, b = position_m[tri[1]] - p, c = position_m[tri[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    solid_angle += 2 * std::atan2(a.dot(b.cross(c)),
                                  la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4 * M_PI);
}

}  // namespace

bool IsInside(const Model& model, const Body& body, std::span<const Vec3> position_m,
              const Vec3& p) {
  return WindingNumber(model, body, position_m, p) >= 0.5;
}

Penetration MeasurePenetration(const Model& model, std::span<const Vec3> position_m) {
  Penetration result;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    if (!body.closed) continue;
    Aabb box;
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p)
      box.Add(position_m[p]);
    for (int p = 0; p < model.particle_count(); ++p) {
      if (model.body_of[p] == static_cast<int>(b) || !box.Contains(position_m[p])) continue;
      if (!IsInside(model, body, position_m, position_m[p])) continue;
      double nearest_sq = std::numeric_limits<double>::infinity();
      for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
        const Triangle& tri = model.triangles[t];
        nearest_sq =
            std::min(nearest_sq, ClosestPointOnTriangle(position_m[p], position_m[tri[0]],
                                                        position_m[tri[1]], position_m[tri[2]])
                                     .distance_sq_m2);
      }
      ++result.vertices_inside;
      result.max_depth_m = std::max(result.max_depth_m, std::sqrt(nearest_sq));
    }
  }
  return result;
}

}  // namespace adhesim
