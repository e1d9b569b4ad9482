#pragma once

#include <array>
#include <span>
#include <variant>
#include <vector>

#include "core/model/geometry.h"
#include "core/model/model.h"

namespace adhesim {

// The convex solids that tools are made of, in double, in the tool's frame (tip at the origin,
// shaft along +z). The same solids are handed to Bullet as shapes; a test compares the two.

// A solid of revolution about z: a cone from `apex_z` to `shoulder_z`, then a cylinder to `end_z`.
// A plain cylinder has apex_z == shoulder_z. Its signed distance is that of the convex profile in
// the half-plane (rho, z), rho >= 0.
struct Round {
  double radius = 0;
  double apex_z = 0;
  double shoulder_z = 0;
  double end_z = 0;
};

// A double-edged blade: a rhombus of width (y) and thickness (x) that tapers to the tip below
// `shoulder_z`.
struct Blade {
  static constexpr int kVertexCount = 9;
  static constexpr int kPlaneCount = 9;
  struct Plane {
    Vec3 normal;    // unit, outwards
    double offset;  // normal . p of the plane's points
  };
  std::array<Vec3, kVertexCount> vertices;
  std::array<Plane, kPlaneCount> planes;
  double end_z = 0;
};

using Solid = std::variant<Round, Blade>;

// A triangle as queries see it, in the tool's frame.
using TriangleCorners = std::array<Vec3, 3>;

// The point of a triangle at which a solid's signed distance is least (for a triangle outside: the
// nearest point; for one that reaches inside: its deepest point), and that signed distance.
struct SolidNearest {
  double distance_m = 0;
  Vec3 weights = Vec3::Zero();  // barycentric coordinates of the point
  Vec3 point_m = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  // unit, from solid to triangle
};

// The solids of a tool, at most two, from the tip up.
std::vector<Solid> SolidsOf(const ToolShape& shape);

// The point of the solid furthest along `direction` (any length but zero).
Vec3 SupportPoint(const Round& round, const Vec3& direction);
Vec3 SupportPoint(const Blade& blade, const Vec3& direction);
Vec3 SupportPoint(const Solid& solid, const Vec3& direction);

// Where a solid ends: its largest z.
double EndZ(const Solid& solid);

// The box around a solid in its own frame.
Aabb BoxOf(const Solid& solid);

// Signed distance of a point: negative inside.
double SignedDistance(const Solid& solid, const Vec3& point);

// True, and the nearest point, when the triangle comes within `within_m`. Finite for degenerate
// triangles; false for non-finite ones. Allocates nothing.
bool NearestOnTriangle(const Solid& solid, const TriangleCorners& corners, double within_m,
                       SolidNearest* nearest);

}  // namespace adhesim
