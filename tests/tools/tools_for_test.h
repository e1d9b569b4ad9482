#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/tools/tool_set.h"

namespace adhesim {

// The needle and lancet of scene.proto's defaults.
inline constexpr double kNeedleLength = 0.12, kNeedleRadius = 0.0015, kNeedleTip = 0.004;

inline ToolModel Needle() {
  ToolModel tool;
  tool.name = "needle";
  tool.shape = NeedleShape{kNeedleLength, kNeedleRadius, kNeedleTip};
  return tool;
}

inline ToolModel Lancet() {
  ToolModel tool;
  tool.name = "lancet";
  tool.shape = LancetShape{0.025, 0.006, 0.0006, 0.1, 0.003};
  return tool;
}

inline std::unique_ptr<ToolSet> MakeTools(const std::vector<ToolModel>& tools,
                                          const std::vector<TriangleMesh>& meshes = {}) {
  std::vector<ToolSet::Obstacle> obstacles;
  for (const TriangleMesh& mesh : meshes) obstacles.push_back({mesh.vertices, mesh.triangles});
  auto made = ToolSet::Create(tools, obstacles);
  EXPECT_TRUE(made.ok()) << made.status();
  return made.ok() ? std::move(*made) : nullptr;
}

// A box, closed, its faces cut into `cells` x `cells` squares of two triangles.
inline TriangleMesh BoxMesh(const Vec3& centre, const Vec3& size, int cells = 1) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      const int first = static_cast<int>(mesh.vertices.size());
      for (int i = 0; i <= cells; ++i) {
        for (int j = 0; j <= cells; ++j) {
          Vec3 p;
          p[axis] = 0.5 * side;
          p[(axis + 1) % 3] = static_cast<double>(i) / cells - 0.5;
          p[(axis + 2) % 3] = static_cast<double>(j) / cells - 0.5;
          mesh.vertices.push_back(centre + p.cwiseProduct(size));
        }
      }
      for (int i = 0; i < cells; ++i) {
        for (int j = 0; j < cells; ++j) {
          const int a = first + i * (cells + 1) + j, b = a + cells + 1, c = b + 1, d = a + 1;
          if (side > 0) {
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({a, c, d});
          } else {
            mesh.triangles.push_back({a, c, b});
            mesh.triangles.push_back({a, d, c});
          }
        }
      }
    }
  }
  return mesh;
}

// Numbers from a fixed generator (SplitMix64): the same on every machine.
class Numbers {
 public:
  double Uniform(double low, double high) {
    state_ += 0x9E3779B97F4A7C15ull;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return low + (high - low) * (static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53);
  }
  Vec3 InBox(double half) {
    return {Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)};
  }
  Quat Rotation() {
    Quat q(Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1));
    return q.norm() > 0.1 ? q.normalized() : Quat::Identity();
  }

 private:
  std::uint64_t state_ = 1;
};

}  // namespace adhesim
