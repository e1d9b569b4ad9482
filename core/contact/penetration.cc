#include "core/contact/penetration.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/model/closest_point.h"

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

// Six times the volume of a tetrahedron: > 0 when d is on the outer side of abc.
double Volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return (b - a).cross(c - a).dot(d - a);
}

bool PassesThrough(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  if (Volume(a, b, c, p) * Volume(a, b, c, q) >= 0) return false;
  const double u = Volume(p, q, a, b), v = Volume(p, q, b, c), w = Volume(p, q, c, a);
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

Aabb BoxOf(std::span<const Vec3> position_m, std::span<const std::int32_t> particles) {
  Aabb box;
  for (int p : particles) box.Add(position_m[p]);
  return box;
}

}  // namespace

bool IsInside(const Model& model, const Body& body, std::span<const Vec3> position_m,
              const Vec3& p) {
  return WindingNumber(model, body, position_m, p) >= 0.5;
}

int CountEdgesThrough(const Model& model, std::span<const Vec3> position_m, bool self) {
  std::vector<Aabb> box;
  for (const Body& body : model.bodies) {
    box.emplace_back();
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p)
      box.back().Add(position_m[p]);
  }
  int count = 0;
  for (int p = 0; p < model.particle_count(); ++p) {
    for (int k = model.neighbour_start[p]; k < model.neighbour_start[p + 1]; ++k) {
      const int q = model.neighbours[k];
      if (q < p) continue;
      const Aabb edge = BoxOf(position_m, std::array{p, q});
      for (std::size_t b = 0; b < model.bodies.size(); ++b) {
        const bool own = model.body_of[p] == static_cast<int>(b);
        if ((own && !self) || !box[b].Overlaps(edge)) continue;
        const Body& body = model.bodies[b];
        for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
          const Triangle& tri = model.triangles[t];
          if (own && std::ranges::any_of(tri, [&](int v) { return v == p || v == q; })) continue;
          if (!BoxOf(position_m, tri).Overlaps(edge)) continue;
          count += PassesThrough(position_m[p], position_m[q], position_m[tri[0]],
                                 position_m[tri[1]], position_m[tri[2]]);
        }
      }
    }
  }
  return count;
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
      if (model.body_of[p] == static_cast<int>(b) || !model.OnSurface(p)) continue;
      if (!box.Contains(position_m[p])) continue;
      if (!IsInside(model, body, position_m, position_m[p])) continue;
      double nearest_sq = std::numeric_limits<double>::infinity();
      int nearest = body.first_triangle;
      for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
        const Triangle& tri = model.triangles[t];
        const double distance_sq = ClosestPointOnTriangle(position_m[p], position_m[tri[0]],
                                                          position_m[tri[1]], position_m[tri[2]])
                                       .distance_sq_m2;
        if (!(distance_sq < nearest_sq)) continue;
        nearest_sq = distance_sq;
        nearest = t;
      }
      const auto fixed = [&model](int v) { return model.fixed[v] != 0; };
      if (fixed(p) && std::ranges::all_of(model.triangles[nearest], fixed)) continue;
      ++result.vertices_inside;
      result.max_depth_m = std::max(result.max_depth_m, std::sqrt(nearest_sq));
    }
  }
  return result;
}

}  // namespace adhesim
