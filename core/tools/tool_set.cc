#include "core/tools/tool_set.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/tools/bullet_bodies.h"
#include "core/tools/sweep.h"

namespace adhesim {
namespace {

constexpr double kLargestMargin = 1e-4;
constexpr double kMarginOfThickness = 0.01;

bool IsFinite(const Pose& pose) {
  return pose.position_m.allFinite() && pose.orientation.coeffs().allFinite();
}

absl::Status CheckLengths(const ToolModel& tool,
                          std::initializer_list<std::pair<const char*, double>> lengths) {
  for (const auto& [name, value] : lengths) {
    if (!(std::isfinite(value) && value > 0)) {
      return absl::InvalidArgumentError(absl::StrCat("tool '", tool.name, "': ", name, " is ",
                                                     value, "; permitted: finite and above 0"));
    }
  }
  return absl::OkStatus();
}

absl::Status Check(const ToolModel& tool) {
  if (const auto* needle = std::get_if<NeedleShape>(&tool.shape)) {
    if (auto status = CheckLengths(tool, {{"length_m", needle->length_m},
                                          {"radius_m", needle->radius_m},
                                          {"tip_length_m", needle->tip_length_m}});
        !status.ok()) {
      return status;
    }
    if (needle->tip_length_m < needle->length_m) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("tool '", tool.name, "': tip_length_m is ", needle->tip_length_m,
                     "; permitted: below length_m = ", needle->length_m));
  }
  const auto& lancet = std::get<LancetShape>(tool.shape);
  return CheckLengths(tool, {{"blade_length_m", lancet.blade_length_m},
                             {"blade_width_m", lancet.blade_width_m},
                             {"blade_thickness_m", lancet.blade_thickness_m},
                             {"handle_length_m", lancet.handle_length_m},
                             {"handle_radius_m", lancet.handle_radius_m}});
}

absl::Status Check(const ToolSet::Obstacle& obstacle, std::size_t number) {
  for (std::size_t t = 0; t < obstacle.triangles.size(); ++t) {
    for (const std::int32_t corner : obstacle.triangles[t]) {
      if (corner < 0 || static_cast<std::size_t>(corner) >= obstacle.points_m.size()) {
        return absl::InvalidArgumentError(absl::StrCat("obstacle ", number, ", triangle ", t,
                                                       ": point ", corner, "; permitted: 0 to ",
                                                       obstacle.points_m.size(), " - 1"));
      }
      if (!obstacle.points_m[corner].allFinite()) {
        return absl::InvalidArgumentError(
            absl::StrCat("obstacle ", number, ", point ", corner, " is not finite"));
      }
    }
  }
  return absl::OkStatus();
}

class BulletToolSet final : public ToolSet {
 public:
  BulletToolSet(std::vector<ToolBody> tools, std::vector<ObstacleBody> obstacles)
      : tools_(std::move(tools)), obstacles_(std::move(obstacles)) {}

  Aabb Bounds(int tool, const Pose& pose) const override { return tools_[tool].BoxAt(pose); }

  bool NearestOnTriangle(int tool, const Pose& pose, const Vec3& a, const Vec3& b, const Vec3& c,
                         double within_m, Nearest* nearest) const override {
    const Mat3 to_tool = pose.orientation.conjugate().toRotationMatrix();
    const TriangleCorners corners = {to_tool * (a - pose.position_m),
                                     to_tool * (b - pose.position_m),
                                     to_tool * (c - pose.position_m)};
    bool found = false;
    SolidNearest best;
    const Solid* best_solid = nullptr;
    for (const Solid& solid : tools_[tool].solids()) {
      SolidNearest candidate;
      if (!adhesim::NearestOnTriangle(solid, corners, within_m, &candidate)) continue;
      if (!found || candidate.distance_m < best.distance_m) {
        best = candidate;
        best_solid = &solid;
      }
      found = true;
    }
    if (!found) return false;
    nearest->distance_m = best.distance_m;
    nearest->weights = best.weights;
    nearest->point_m = pose * best.point_m;
    nearest->normal = pose.orientation * best.normal;
    // The tool's own point: back from the triangle by the signed distance.
    nearest->axial_m =
        std::clamp(best.point_m.z() - best.distance_m * best.normal.z(), 0.0, EndZ(*best_solid));
    return true;
  }

  double Sweep(int tool, const Pose& from, const Pose& to, std::span<const Pose> poses,
               Vec3* normal) const override {
    if (!IsFinite(from) || !IsFinite(to)) {
      *normal = Vec3::UnitZ();
      return 0;
    }
    const ToolBody& body = tools_[tool];
    const double margin = std::min(kLargestMargin, kMarginOfThickness * body.half_thickness_m());
    Sweeper sweeper(body, Motion(from, to), margin);
    while (sweeper.BeginRound()) {
      for (const ObstacleBody& obstacle : obstacles_) {
        obstacle.ForEachTriangleNear(
            sweeper.box(), [&](const TriangleCorners& corners) { sweeper.Meet(corners); });
      }
      for (int other = 0; other < static_cast<int>(poses.size()); ++other) {
        if (other != tool && IsFinite(poses[other])) sweeper.Meet(tools_[other], poses[other]);
      }
    }
    if (sweeper.fraction() < 1) *normal = sweeper.normal();
    return sweeper.fraction();
  }

 private:
  std::vector<ToolBody> tools_;
  std::vector<ObstacleBody> obstacles_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ToolSet>> ToolSet::Create(std::span<const ToolModel> tools,
                                                         std::span<const Obstacle> obstacles) {
  std::vector<ToolBody> bodies;
  for (const ToolModel& tool : tools) {
    if (auto status = Check(tool); !status.ok()) return status;
    bodies.emplace_back(tool.shape);
  }
  std::vector<ObstacleBody> surfaces;
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    if (auto status = Check(obstacles[i], i); !status.ok()) return status;
    if (!obstacles[i].triangles.empty())
      surfaces.emplace_back(obstacles[i].points_m, obstacles[i].triangles);
  }
  return std::make_unique<BulletToolSet>(std::move(bodies), std::move(surfaces));
}

}  // namespace adhesim
