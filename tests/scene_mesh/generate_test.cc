#include "core/scene/mesh/generate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/scene/mesh/check_mesh.h"

namespace adhesim {
namespace {

TEST(Icosphere, HasTheParticlesOfItsFormula) {
  for (int n = 0, four_n = 1; n <= 4; ++n, four_n *= 4) {
    const TriangleMesh mesh = MakeIcosphere(2.0, n);
    EXPECT_EQ(mesh.vertices.size(), 10u * four_n + 2);
    EXPECT_EQ(mesh.triangles.size(), 20u * four_n);
    // One rounding of the scale and one of the product.
    for (const Vec3& v : mesh.vertices) EXPECT_NEAR(v.norm(), 2.0, 1e-15 * 4);
  }
}

TEST(Icosphere, IsAClosedSphereThatLooksOutwards) {
  const MeshCheck check = CheckMesh(MakeIcosphere(1.0, 4));
  EXPECT_TRUE(check.flaws.empty());
  EXPECT_TRUE(check.report.closed && check.report.manifold && check.report.oriented);
  EXPECT_EQ(check.report.genus, 0);
  // Inscribed: the volume misses a part of about (edge / 2r)^2, here 0.07^2 / 4.
  EXPECT_NEAR(check.report.volume_m3, 4.0 / 3 * std::numbers::pi, 0.02);
  EXPECT_LT(check.report.volume_m3, 4.0 / 3 * std::numbers::pi);
}

TEST(Sheet, IsOpenFlatAndLooksUp) {
  const TriangleMesh mesh = MakeSheet(0.4, 0.1, 9, 3);
  ASSERT_EQ(mesh.vertices.size(), 27u);
  ASSERT_EQ(mesh.triangles.size(), 32u);
  for (const auto [a, b, c] : mesh.triangles) {
    const Vec3 normal =
        (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    EXPECT_GT(normal.z(), 0);
    EXPECT_EQ(normal.head<2>(), Eigen::Vector2d::Zero());
  }
  const MeshCheck check = CheckMesh(mesh);
  EXPECT_TRUE(check.flaws.empty());
  EXPECT_FALSE(check.report.closed);
  EXPECT_EQ(check.report.boundary_edges, 2 * 8 + 2 * 2);
  EXPECT_NEAR(check.report.area_m2, 0.04, 1e-16);  // a sum of 32 terms: round-off
  EXPECT_EQ(check.report.box.min, Vec3(-0.2, -0.05, 0));
}

TEST(Block, IsTheClosedSurfaceOfABox) {
  const TriangleMesh mesh = MakeBlock({0.4, 0.2, 0.1}, 4);  // 4 x 2 x 1 cells
  EXPECT_EQ(mesh.triangles.size(), 2u * 2 * (4 * 2 + 2 * 1 + 4 * 1));
  const MeshCheck check = CheckMesh(mesh);
  EXPECT_TRUE(check.flaws.empty());
  EXPECT_TRUE(check.report.closed);
  EXPECT_EQ(check.report.genus, 0);
  EXPECT_NEAR(check.report.volume_m3, 0.008, 1e-17);  // a sum of 56 terms: round-off
  EXPECT_EQ(check.report.box.max, Vec3(0.2, 0.1, 0.05));
}

TEST(Block, OfOneCellHasEightParticles) {
  const TriangleMesh mesh = MakeBlock({1, 1, 1}, 1);
  EXPECT_EQ(mesh.vertices.size(), 8u);
  EXPECT_EQ(mesh.triangles.size(), 12u);
}

TEST(Block, KeepsAtLeastOneCellAcrossAThinSide) {
  EXPECT_TRUE(CheckMesh(MakeBlock({1, 0.001, 1}, 3)).flaws.empty());
}

}  // namespace
}  // namespace adhesim
