#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/statusor.h>

#include <memory>
#include <span>
#include <vector>

#include "core/model/geometry.h"
#include "core/model/model.h"
#include "core/tools/solid.h"

namespace adhesim {

// Tools and obstacles as Bullet holds them. Bullet's types stay in the source file.
//
// Debian's Bullet computes in single precision: 6e-8 of the distance from the origin. Tools are
// therefore held in their own frame and obstacles about their own centre, and Bullet answers only
// what single precision is good enough for (which triangles are near; the way out of an overlap).
// Distances are computed in double.

// A tool: a kinematic rigid body with a compound of convex shapes, in the tool's frame, without
// collision margins.
class ToolBody {
 public:
  explicit ToolBody(const ToolShape& shape);
  ~ToolBody();
  ToolBody(ToolBody&&) noexcept;

  std::span<const Solid> solids() const { return solids_; }
  // The box around the tool at a pose.
  Aabb BoxAt(const Pose& pose) const;
  // Greatest distance of a point of the tool from its tip.
  double reach_m() const { return reach_m_; }
  // Radius of the shaft, or half of the thinnest part.
  double half_thickness_m() const { return half_thickness_m_; }

  // The point furthest along a direction as Bullet's compound has it.
  Vec3 BulletSupport(const Vec3& direction) const;

  // For overlapping solids of two tools: the direction (unit, from this to the other) along which
  // they are parted soonest. `relative` is the other's pose in this tool's frame.
  Vec3 OverlapDirection(int solid, const ToolBody& other, int other_solid,
                        const Pose& relative) const;

 private:
  struct Bullet;
  std::vector<Solid> solids_;
  double reach_m_;
  double half_thickness_m_;
  std::unique_ptr<Bullet> bullet_;
};

// A fixed surface: a Bullet triangle mesh with a bounding-volume tree, about the surface's own
// centre.
class ObstacleBody {
 public:
  // Indices must be in range, points finite, and there must be a triangle.
  ObstacleBody(std::span<const Vec3> points_m, std::span<const Triangle> triangles);
  ~ObstacleBody();
  ObstacleBody(ObstacleBody&&) noexcept;

  // Calls `visit` with every triangle (world, double) whose box meets `box`, and perhaps a few
  // more. Allocates nothing.
  void ForEachTriangleNear(const Aabb& box,
                           absl::FunctionRef<void(const TriangleCorners&)> visit) const;

 private:
  struct Bullet;
  std::vector<Vec3> points_m_;
  std::vector<Triangle> triangles_;
  Aabb box_;
  Vec3 centre_m_;
  std::unique_ptr<Bullet> bullet_;
};

}  // namespace adhesim
