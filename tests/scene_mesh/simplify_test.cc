#include "core/scene/mesh/simplify.h"

#include <gtest/gtest.h>

#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/generate.h"

namespace adhesim {
namespace {

TEST(Decimated, SphereKeepsItsKindAndMostOfItsVolume) {
  const TriangleMesh sphere = MakeIcosphere(1, 3);
  const double volume_m3 = CheckMesh(sphere).report.volume_m3;
  for (const int vertices : {162, 42}) {
    const absl::StatusOr<TriangleMesh> mesh = Decimated(sphere, vertices);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    const MeshCheck check = CheckMesh(*mesh);
    EXPECT_TRUE(check.flaws.empty());
    EXPECT_EQ(check.report.vertices, vertices);
    EXPECT_EQ(check.report.triangles, 2 * vertices - 4);
    EXPECT_TRUE(check.report.closed && check.report.manifold && check.report.oriented);
    EXPECT_EQ(check.report.euler_characteristic, 2);
    EXPECT_GE(check.report.min_angle_deg, 12);  // what a collapse may make
    // The icosphere of as many vertices, all on the sphere, loses 13 % (42) and 3.5 % (162).
    EXPECT_GE(check.report.volume_m3, (vertices == 42 ? 0.87 : 0.96) * volume_m3);
    EXPECT_LE(check.report.volume_m3, 1.05 * volume_m3);
    EXPECT_EQ(Decimated(sphere, vertices)->vertices, mesh->vertices);
  }
  EXPECT_EQ(Decimated(sphere, 642)->vertices, sphere.vertices);
}

TEST(Decimated, RefusesWhatCannotBe) {
  const TriangleMesh sphere = MakeIcosphere(1, 2);
  EXPECT_NE(Decimated(sphere, 163).status().message().find("at most"), absl::string_view::npos);
  EXPECT_NE(Decimated(sphere, 4).status().message().find("keep its shape"),
            absl::string_view::npos);
  EXPECT_NE(Decimated(MakeSheet(1, 1, 9, 9), 42).status().message().find("closed"),
            absl::string_view::npos);
}

}  // namespace
}  // namespace adhesim
