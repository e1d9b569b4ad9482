#include "core/scene/mesh/surface_from_labels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <numbers>

#include "core/scene/build_model.h"
#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/generate.h"
#include "core/scene/mesh/isosurface.h"
#include "core/scene/mesh/read_surface.h"
#include "tests/scene_mesh/files.h"

namespace adhesim {
namespace {

// An image of n^3 voxels of 1 mm, solid where `is_solid` says so of the voxel's centre [mm].
SolidMap Image(int n, const std::function<bool(const Vec3&)>& is_solid) {
  SolidMap map{{n, n, n}, Vec3::Constant(1e-3), {}, {1}};
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) map.solid.push_back(is_solid(Vec3(x + 0.5, y + 0.5, z + 0.5)));
    }
  }
  return map;
}

bool InBall(const Vec3& p, const Vec3& centre, double radius) {
  return (p - centre).norm() < radius;
}

// Fit to be a body: closed, manifold, oriented outwards, in one piece, nothing degenerate.
MeshReport ExpectSound(const TriangleMesh& mesh, int genus) {
  const MeshCheck check = CheckMesh(mesh);
  for (const MeshFlaw& flaw : check.flaws) ADD_FAILURE() << flaw.message;
  EXPECT_TRUE(check.report.closed && check.report.manifold && check.report.oriented);
  EXPECT_EQ(check.report.genus, genus);
  EXPECT_GT(check.report.volume_m3, 0);
  return check.report;
}

TEST(SurfaceFromLabels, MakesABallOfTheRightSize) {
  const SolidMap map = Image(60, [](const Vec3& p) { return InBall(p, {30, 30, 30}, 25); });
  const auto mesh = SurfaceFromLabels(map, 500);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  const MeshReport report = ExpectSound(*mesh, 0);
  EXPECT_EQ(report.vertices, 500);
  EXPECT_GT(report.min_angle_deg, 20);
  // Voxels of 1/25 radius: the volume is off by well under 1 %.
  EXPECT_NEAR(report.volume_m3 / (4.0 / 3 * std::numbers::pi * 25e-3 * 25e-3 * 25e-3), 1, 0.01);
  for (const Vec3& v : mesh->vertices) EXPECT_NEAR(v.norm(), 0.025, 0.001);  // a voxel
}

TEST(SurfaceFromLabels, KeepsTheLargestSolidAndItsHandleButNoCavity) {
  const SolidMap map = Image(64, [](const Vec3& p) {
    const double ring = std::hypot(p.x() - 28, p.y() - 28) - 17;
    const bool torus = std::hypot(ring, p.z() - 28) < 8;
    const bool cavity = std::hypot(ring, p.z() - 28) < 3 && p.x() > 40;
    return (torus && !cavity) || InBall(p, {59, 59, 59}, 4);
  });
  const auto mesh = SurfaceFromLabels(map, 800);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  const MeshReport report = ExpectSound(*mesh, 1);
  EXPECT_NEAR(report.vertices, 800, 16);
  // 2 pi^2 R r^2 without the cavity and the small ball; voxels of 1/8 of the tube's radius.
  EXPECT_NEAR(report.volume_m3 / (2 * std::numbers::pi * std::numbers::pi * 17 * 64 * 1e-9), 1,
              0.03);
}

TEST(SurfaceFromLabels, ReachesTheNumberAskedForWithinTwoPercent) {
  const SolidMap map = Image(50, [](const Vec3& p) {
    return InBall(p, {18, 25, 25}, 15) || InBall(p, {34, 25, 25}, 12);
  });
  for (const int particles : {50, 137, 1500, 20000}) {
    const auto mesh = SurfaceFromLabels(map, particles);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_NEAR(static_cast<double>(mesh->vertices.size()), particles, 0.02 * particles);
    ExpectSound(*mesh, 0);
  }
}

TEST(SurfaceFromLabels, IsCentredOnItsVolume) {
  const SolidMap map = Image(40, [](const Vec3& p) { return InBall(p, {12, 20, 28}, 9); });
  const auto mesh = SurfaceFromLabels(map, 300);
  ASSERT_TRUE(mesh.ok());
  Vec3 centre = Vec3::Zero();
  for (const auto [a, b, c] : mesh->triangles) {
    const Vec3 &p = mesh->vertices[a], &q = mesh->vertices[b], &r = mesh->vertices[c];
    centre += p.dot(q.cross(r)) * (p + q + r) / 24;
  }
  // Round-off of some 600 terms of 1e-11 m^4, over the volume of 3e-6 m^3.
  EXPECT_LT(centre.norm() / 3e-6, 1e-15);
}

TEST(SurfaceFromLabels, SurvivesNoiseAndTinySolids) {
  unsigned noise = 1;
  const SolidMap noisy =
      Image(24, [&](const Vec3&) { return (noise = noise * 1664525u + 1013904223u) >> 31; });
  const auto mesh = SurfaceFromLabels(noisy, 300);
  if (mesh.ok()) {  // a sponge may have any genus; nothing else may be wrong with it
    EXPECT_TRUE(CheckMesh(*mesh).flaws.empty());
  }
  const auto voxel = SurfaceFromLabels(Image(1, [](const Vec3&) { return true; }), 100);
  ASSERT_TRUE(voxel.ok()) << voxel.status();
  ExpectSound(*voxel, 0);
  EXPECT_FALSE(SurfaceFromLabels(Image(8, [](const Vec3&) { return false; }), 100).ok());
}

TEST(SurfaceFromLabels, GivesTheSameBytesEachTime) {
  const auto first = MakeOrgan(0.2, 600), second = MakeOrgan(0.2, 600);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->vertices, second->vertices);
  EXPECT_EQ(first->triangles, second->triangles);
}

TEST(MarchTetrahedra, IsClosedAndManifoldForAnyPattern) {
  // Random cells, corner contacts and all: Kuhn's subdivision leaves no ambiguous case.
  unsigned noise = 7;
  OccupancyGrid grid{{12, 12, 12}, 1.0, std::vector<float>(12 * 12 * 12, 0.0f)};
  for (int z = 1; z < 11; ++z) {
    for (int y = 1; y < 11; ++y) {
      for (int x = 1; x < 11; ++x) {
        noise = noise * 1664525u + 1013904223u;
        grid.fraction[grid.Index(x, y, z)] = static_cast<float>(noise >> 8) / (1 << 24);
      }
    }
  }
  const MeshReport report = CheckMesh(MarchTetrahedra(grid)).report;
  EXPECT_TRUE(report.closed && report.manifold && report.oriented);
  EXPECT_EQ(report.degenerate_triangles, 0);
}

TEST(Average, KeepsTheVolumeForAnyCellSize) {
  const SolidMap map = Image(20, [](const Vec3& p) { return InBall(p, {10, 10, 10}, 8); });
  double voxels = 0;
  for (const std::uint8_t v : map.solid) voxels += v;
  for (const double cell_m : {0.3e-3, 1e-3, 2.7e-3, 9e-3}) {
    const OccupancyGrid grid = Average(map, cell_m);
    double cells = 0;
    for (const float f : grid.fraction) cells += f;
    // Fractions are kept in single precision.
    EXPECT_NEAR(cells * cell_m * cell_m * cell_m / (voxels * 1e-9), 1, 1e-5);
  }
}

TEST(Organ, IsSoundAndAsLongAsAskedFor) {
  for (const int particles : {50, 400, 1500}) {
    const auto mesh = MakeOrgan(0.2, particles);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    const MeshReport report = ExpectSound(*mesh, 0);
    EXPECT_NEAR(report.vertices, particles, 0.02 * particles);
    EXPECT_NEAR(report.box.max.x() - report.box.min.x(), 0.2, 1e-15);
    EXPECT_GT(report.min_angle_deg, 15);
  }
}

TEST(ReadAnySurface, ReadsMeshesAndLabelMaps) {
  std::string inr =
      "#INRIMAGE-4#{\nXDIM=20\nYDIM=20\nZDIM=20\nTYPE=unsigned fixed\nPIXSIZE=8 bits\n";
  inr.resize(252, '\n');
  inr += "##}\n";
  for (const std::uint8_t v : Image(20, [](const Vec3& p) {
                                return InBall(p, {10, 10, 10}, 8);
                              }).solid) {
    inr.push_back(static_cast<char>(v * 255));
  }
  const TemporaryFile labels("ball.inr", inr);
  const auto surface = ReadAnySurface(labels.path(), 200);
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_EQ(surface->vertices.size(), 200u);
  const TemporaryFile obj("ball.obj", WriteObj(MakeIcosphere(1, 1)));
  EXPECT_TRUE(ReadAnySurface(obj.path()).ok());
  EXPECT_EQ(ReadAnySurface("/nonexistent/x.inr.gz").status().code(), absl::StatusCode::kNotFound);

  // The same through a scene, as an asset below an ancestor of the scene's folder.
  std::filesystem::create_directories(labels.directory() + "/build/assets");
  std::filesystem::copy_file(labels.path(), labels.directory() + "/build/assets/organ.inr");
  v1::Scene scene;
  v1::Body* body = scene.add_bodies();
  body->set_name("organ");
  body->set_mass_kg(1);
  body->mutable_label_map()->set_file("asset:organ.inr");
  body->mutable_label_map()->set_particles(100);
  const BuiltModel built = BuildModel(scene, labels.directory() + "/scenes/training");
  ASSERT_NE(built.model, nullptr) << built.problems.at(0).message;
  EXPECT_EQ(built.model->particle_count(), 100);
  EXPECT_TRUE(built.model->bodies[0].closed);
}

TEST(BuildModel, NamesTheScriptWhenAnAssetIsMissing) {
  v1::Scene scene;
  v1::Body* body = scene.add_bodies();
  body->set_name("organ");
  body->set_mass_kg(1);
  body->mutable_label_map()->set_file("asset:nowhere.inr.gz");
  const BuiltModel built = BuildModel(scene, ".");
  ASSERT_EQ(built.problems.size(), 1u);
  EXPECT_EQ(built.problems[0].path, "bodies[0].label_map.file");
  EXPECT_NE(built.problems[0].message.find("scenes/fetch_assets.sh"), std::string::npos);
  body->mutable_label_map()->set_file("asset:../../etc/passwd");
  EXPECT_NE(BuildModel(scene, ".").problems.at(0).message.find("without a folder"),
            std::string::npos);
}

// The real liver, where set-up could get it.
TEST(RealLiver, BecomesAnEvenClosedSurface) {
  const auto path = ResolveFile("asset:liver.inr.gz", ADHESIM_SOURCE_DIR);
  if (!path.ok()) GTEST_SKIP() << path.status().message();
  const auto mesh = ReadAnySurface(*path, 1500);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  const MeshReport report = ExpectSound(*mesh, 0);
  EXPECT_NEAR(report.vertices, 1500, 30);
  // The labelled voxels measure 1.774 litres; averaging leaves out nothing.
  EXPECT_NEAR(report.volume_m3, 1.774e-3, 0.01e-3);
  EXPECT_GT(report.min_angle_deg, 20);
}

}  // namespace
}  // namespace adhesim
