#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <span>

#include "core/model/geometry.h"
#include "core/model/model.h"

namespace adhesim {

// The tools' shapes as Bullet kinematic bodies, and what contact and motion need of them.
//
// Bullet (single precision) works near the tool's own origin: every query first moves its arguments
// into the tool's frame in double. All queries are const in effect, allocate nothing and give the
// same bits each time.
class ToolSet {
 public:
  // The point of a triangle nearest to a tool.
  struct Nearest {
    double distance_m;  // negative inside the tool
    Vec3 point_m;       // on the triangle, world
    Vec3 normal;        // unit, from tool to triangle, world
    Vec3 weights;       // barycentric coordinates of `point_m`
    double axial_m;     // distance of the tool's point behind the tip, along the shaft
  };

  // A closed or open fixed surface that stops tools.
  struct Obstacle {
    std::span<const Vec3> points_m;
    std::span<const Triangle> triangles;  // indices into `points_m`
  };

  static absl::StatusOr<std::unique_ptr<ToolSet>> Create(std::span<const ToolModel> tools,
                                                         std::span<const Obstacle> obstacles);
  virtual ~ToolSet() = default;

  // The box around the tool at a pose.
  virtual Aabb Bounds(int tool, const Pose& pose) const = 0;

  // True, and the nearest point, when the triangle is within `within_m` of the tool at `pose`.
  virtual bool NearestOnTriangle(int tool, const Pose& pose, const Vec3& a, const Vec3& b,
                                 const Vec3& c, double within_m, Nearest* nearest) const = 0;

  // Largest fraction in [0, 1] of the motion from `from` to `to` (translation and rotation
  // together) that the tool can make before it comes within a small margin of an obstacle or of
  // another tool at its pose in `poses` [#tools]. When less than 1, `*normal` is the unit normal of
  // what it meets, towards the tool.
  virtual double Sweep(int tool, const Pose& from, const Pose& to, std::span<const Pose> poses,
                       Vec3* normal) const = 0;
};

}  // namespace adhesim
