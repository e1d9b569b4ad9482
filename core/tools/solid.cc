#include "core/tools/solid.h"

#include <algorithm>
#include <cmath>

#include "core/tools/nearest.h"

namespace adhesim {
namespace {

// The plane through three points, facing away from `inside`.
Blade::Plane PlaneThrough(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& inside) {
  Vec3 normal = (b - a).cross(c - a).normalized();
  if (normal.dot(inside - a) > 0) normal = -normal;
  return {normal, normal.dot(a)};
}

Blade MakeBlade(const LancetShape& shape) {
  const double x = shape.blade_thickness_m / 2, y = shape.blade_width_m / 2;
  const double end = shape.blade_length_m;
  // The point is as long as the blade is wide, and at most half the blade.
  const double shoulder = std::min(shape.blade_width_m, end / 2);
  Blade blade;
  blade.end_z = end;
  const std::array<Vec3, 4> rhombus = {Vec3(x, 0, 0), Vec3(0, y, 0), Vec3(-x, 0, 0),
                                       Vec3(0, -y, 0)};
  blade.vertices[0] = Vec3::Zero();
  for (int i = 0; i < 4; ++i) {
    blade.vertices[1 + i] = rhombus[i] + shoulder * Vec3::UnitZ();
    blade.vertices[5 + i] = rhombus[i] + end * Vec3::UnitZ();
  }
  const Vec3 inside(0, 0, 0.75 * end);
  for (int i = 0; i < 4; ++i) {
    const Vec3& here = blade.vertices[1 + i];
    const Vec3& next = blade.vertices[1 + (i + 1) % 4];
    blade.planes[i] = PlaneThrough(blade.vertices[0], here, next, inside);
    blade.planes[4 + i] = PlaneThrough(here, next, blade.vertices[5 + i], inside);
  }
  blade.planes[8] = {Vec3::UnitZ(), end};
  return blade;
}

// A point is a triangle of size zero.
double BladeDistance(const Blade& blade, const Vec3& point) {
  SolidNearest nearest;
  NearestOnTriangle(Solid(blade), {point, point, point}, std::numeric_limits<double>::infinity(),
                    &nearest);
  return nearest.distance_m;
}

}  // namespace

std::vector<Solid> SolidsOf(const ToolShape& shape) {
  if (const auto* needle = std::get_if<NeedleShape>(&shape)) {
    return {Round{needle->radius_m, 0, needle->tip_length_m, needle->length_m}};
  }
  const auto& lancet = std::get<LancetShape>(shape);
  const double handle_start = lancet.blade_length_m;
  return {MakeBlade(lancet), Round{lancet.handle_radius_m, handle_start, handle_start,
                                   handle_start + lancet.handle_length_m}};
}

Vec3 SupportPoint(const Round& round, const Vec3& d) {
  const double across = std::sqrt(d.x() * d.x() + d.y() * d.y());
  const double scale = across > 0 ? round.radius / across : 0;
  const Vec3 rim(scale * d.x(), scale * d.y(), d.z() > 0 ? round.end_z : round.shoulder_z);
  const Vec3 apex(0, 0, round.apex_z);
  return apex.dot(d) > rim.dot(d) ? apex : rim;
}

Vec3 SupportPoint(const Blade& blade, const Vec3& d) {
  int best = 0;
  for (int i = 1; i < Blade::kVertexCount; ++i) {
    if (blade.vertices[i].dot(d) > blade.vertices[best].dot(d)) best = i;
  }
  return blade.vertices[best];
}

Vec3 SupportPoint(const Solid& solid, const Vec3& direction) {
  return std::visit([&](const auto& s) { return SupportPoint(s, direction); }, solid);
}

double EndZ(const Solid& solid) {
  return std::visit([](const auto& s) { return s.end_z; }, solid);
}

Aabb BoxOf(const Solid& solid) {
  if (const auto* round = std::get_if<Round>(&solid)) {
    return {Vec3(-round->radius, -round->radius, round->apex_z),
            Vec3(round->radius, round->radius, round->end_z)};
  }
  // Vertices 5 and 6 are the thickest and the widest of the end face.
  const auto& blade = std::get<Blade>(solid);
  const double x = blade.vertices[5].x(), y = blade.vertices[6].y();
  return {Vec3(-x, -y, 0), Vec3(x, y, blade.end_z)};
}

double SignedDistance(const Solid& solid, const Vec3& point) {
  if (const auto* round = std::get_if<Round>(&solid)) {
    const double rho = std::sqrt(point.x() * point.x() + point.y() * point.y());
    return ProfileDistance(*round, rho, point.z());
  }
  return BladeDistance(std::get<Blade>(solid), point);
}

bool NearestOnTriangle(const Solid& solid, const TriangleCorners& corners, double within_m,
                       SolidNearest* nearest) {
  // Boxes first; written so that a NaN anywhere fails the test.
  const Aabb box = BoxOf(solid);
  const Vec3 low = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]);
  const Vec3 high = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
  for (int axis = 0; axis < 3; ++axis) {
    if (!(low[axis] <= box.max[axis] + within_m && high[axis] >= box.min[axis] - within_m))
      return false;
  }
  for (const Vec3& corner : corners) {
    if (!corner.allFinite()) return false;
  }
  if (const auto* round = std::get_if<Round>(&solid))
    return NearestToRound(*round, corners, within_m, nearest);
  return NearestToBlade(std::get<Blade>(solid), corners, within_m, nearest);
}

}  // namespace adhesim
