// Bodies of tetrahedra whose shape is a block: counts, volumes, masses and surface are known.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string>

#include "core/scene/build_model.h"
#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/lattice.h"
#include "core/scene/validate.h"
#include "tests/support/scene_of_text.h"

namespace adhesim {
namespace {

using test::SceneOfText;

double VolumeOf(const TetMesh& mesh) {
  double sum = 0;
  for (const Tetrahedron& t : mesh.tetrahedra) sum += TetVolume(mesh.surface.vertices, t);
  return sum;
}

TEST(TetBlock, IsFilledExactlyWhateverTheNumbersOfCells) {
  for (const int cells : {1, 2, 3, 5}) {
    for (const Vec3& size : {Vec3(1, 1, 1), Vec3(0.3, 0.2, 0.1), Vec3(0.02, 0.7, 0.35)}) {
      const std::array<int, 3> n = CellsAlong(size, cells);
      const absl::StatusOr<TetMesh> mesh = MakeTetBlock(size, cells);
      ASSERT_TRUE(mesh.ok());
      EXPECT_EQ(mesh->surface.vertices.size(), (n[0] + 1u) * (n[1] + 1u) * (n[2] + 1u));
      EXPECT_EQ(mesh->tetrahedra.size(), 5u * n[0] * n[1] * n[2]);
      const double cell = size.prod() / (n[0] * n[1] * n[2]);
      for (const Tetrahedron& t : mesh->tetrahedra) {
        // A corner of a cell is a sixth of it, the tetrahedron between a third.
        const double part = TetVolume(mesh->surface.vertices, t) / cell;
        EXPECT_NEAR(part, part > 0.25 ? 1.0 / 3 : 1.0 / 6, 1e-12);
      }
      EXPECT_NEAR(VolumeOf(*mesh), size.prod(), 1e-13 * size.prod());
    }
  }
}

// A crack would be a face inside the block that only one tetrahedron has.
TEST(TetBlock, HasEveryInnerFaceTwiceAndNoOther) {
  const Vec3 size(0.3, 0.2, 0.1);
  for (const int cells : {3, 4, 7}) {
    const TetMesh mesh = MakeTetBlock(size, cells).value();
    const std::vector<TetFace> faces = SortedFaces(mesh.tetrahedra);
    for (std::size_t first = 0; first < faces.size();) {
      std::size_t last = first + 1;
      while (last < faces.size() && faces[last].sorted == faces[first].sorted) ++last;
      Vec3 centre = Vec3::Zero();
      for (const int v : faces[first].sorted) centre += mesh.surface.vertices[v] / 3;
      // 1e-12: positions are off by roundings only.
      const bool outside = (centre.cwiseAbs() - size / 2).maxCoeff() > -1e-12;
      EXPECT_EQ(last - first, outside ? 1u : 2u);
      first = last;
    }
  }
}

TEST(TetBlock, HasAnOutwardClosedSurfaceWhoseVerticesComeFirst) {
  const Vec3 size(0.3, 0.2, 0.1);
  const TetMesh mesh = MakeTetBlock(size, 6).value();
  std::int32_t last = 0;
  for (const Triangle& t : mesh.surface.triangles) {
    last = std::max({last, t[0], t[1], t[2]});
    const Vec3 &a = mesh.surface.vertices[t[0]], &b = mesh.surface.vertices[t[1]],
               &c = mesh.surface.vertices[t[2]];
    EXPECT_GT((b - a).cross(c - a).dot(a + b + c), 0);
  }
  const TriangleMesh outside{
      {mesh.surface.vertices.begin(), mesh.surface.vertices.begin() + last + 1},
      mesh.surface.triangles};
  const MeshCheck check = CheckMesh(outside);
  EXPECT_TRUE(check.flaws.empty());  // no vertex is unused, so the inner ones come last
  EXPECT_TRUE(check.report.closed);
  EXPECT_EQ(check.report.genus, 0);
  EXPECT_NEAR(check.report.volume_m3, size.prod(), 1e-15);
  EXPECT_EQ(last + 1, 7 * 5 * 3 - 5 * 3 * 1);  // 6 x 4 x 2 cells
}

TEST(TetBlock, RefusesMoreNodesThanFit) {
  const absl::Status status = MakeTetBlock({1, 1, 1}, 200).status();
  EXPECT_NE(status.message().find("200 x 200 x 200 cells with 8120601 nodes; at most 1000000"),
            std::string::npos)
      << status;
}

constexpr char kTwoBlocks[] = R"(
  bodies { name: "a" block { size_m: [0.3, 0.2, 0.1] } density_kg_m3: 1000 tetrahedra { cells: 6 }
           fixed { half_space { point_m: [-0.149, 0, 0] normal: [1, 0, 0] } } }
  bodies { name: "b" block { size_m: [0.1, 0.1, 0.1] } mass_kg: 3 tetrahedra { cells: 2 }
           position_m: [1, 0, 0] rotation_deg: [30, 40, 50] velocity_m_s: [1, 2, 3] })";

TEST(TetBlock, BecomesABodyWithMassByVolume) {
  const BuiltModel built = BuildModel(SceneOfText(kTwoBlocks), ".");
  for (const Problem& p : built.problems) ADD_FAILURE() << p.path << ": " << p.message;
  ASSERT_NE(built.model, nullptr);
  const Model& model = *built.model;
  const Body &a = model.bodies[0], &b = model.bodies[1];
  EXPECT_EQ(a.tetrahedron_count, 5 * 6 * 4 * 2);
  EXPECT_EQ(b.first_tetrahedron, a.tetrahedron_count);
  EXPECT_EQ(b.tetrahedron_count, 5 * 8);
  EXPECT_EQ(b.particle_count, 27);
  EXPECT_TRUE(a.closed);
  EXPECT_NEAR(a.rest_volume_m3, 0.006, 1e-15);
  EXPECT_EQ(model.fill, std::vector<double>(280, 1.0));
  EXPECT_EQ(model.tet_label, std::vector<std::int32_t>(280, -1));
  EXPECT_EQ(model.tet_group, std::vector<std::int32_t>(280, -1));
  EXPECT_TRUE(model.carried.empty());
  const auto second = model.mass_kg.begin() + b.first_particle;
  EXPECT_NEAR(std::accumulate(model.mass_kg.begin(), second, 0.0), 6, 1e-13);
  EXPECT_NEAR(std::accumulate(second, model.mass_kg.end(), 0.0), 3, 1e-13);
  // The one inner node of eight cells comes last. Each of the cells is even or odd such that it
  // belongs to five tetrahedra or to one; here its coordinates have an odd sum: one each, a sixth.
  EXPECT_NEAR(model.mass_kg.back(), 3 * 8 * (1.0 / 8 / 6 / 4), 1e-13);
  EXPECT_EQ(model.area_m2.back(), 0);
  EXPECT_EQ(model.neighbour_start[b.first_particle + 26],
            model.neighbour_start[model.particle_count()]);
  for (const Tetrahedron& t : model.tetrahedra) {
    EXPECT_GT(TetVolume(model.rest_position_m, t), 0);
  }
  EXPECT_EQ(std::accumulate(model.fixed.begin(), model.fixed.end(), 0), 5 * 3);
  EXPECT_EQ(model.initial_velocity_m_s.back(), Vec3(1, 2, 3));
}

TEST(TetBlock, KeepsSurfaceEffectsOff) {
  const std::string bodies =
      std::string(kTwoBlocks) + R"(bodies { name: "s" icosphere { radius_m: 1 } mass_kg: 1 })";
  const auto problems = [&](const std::string& effects) {
    std::string text;
    for (const Problem& p : ValidateScene(SceneOfText(bodies + effects))) {
      text += p.path + ": " + p.message + "\n";
    }
    return text;
  };
  EXPECT_EQ(problems(R"(effects { shape_memory { stiffness_n_m: 1 } }
                        effects { volume_preservation {} }
                        effects { volume_preservation { bodies: "a" } }
                        effects { elasticity { young_modulus_pa: 5000 } })"),
            "");
  EXPECT_NE(problems(R"(effects { shape_memory { bodies: "a" stiffness_n_m: 1 } })")
                .find("effects[0].shape_memory.bodies[0]: body 'a' consists of tetrahedra"),
            std::string::npos);
  EXPECT_NE(problems(R"(effects { elasticity { bodies: "s" young_modulus_pa: 1 } })")
                .find("effects[0].elasticity.bodies[0]: body 's' is its surface only"),
            std::string::npos);
  EXPECT_NE(problems(R"(effects { elasticity { bodies: "a" young_modulus_pa: 1 } }
                        effects { elasticity { young_modulus_pa: 1 } })")
                .find("effects[1].elasticity: acts on body 'a', as effects[0]"),
            std::string::npos);
}

TEST(TetBlock, RefusesTetrahedraThatMakeNoSense) {
  const auto first = [](const std::string& body) {
    const Problems problems =
        ValidateScene(SceneOfText("bodies { name: 'b' mass_kg: 1 " + body + "}"));
    return problems.empty() ? "" : problems[0].path + ": " + problems[0].message;
  };
  EXPECT_NE(first("block { size_m: [1,1,1] } tetrahedra { cells: 2 } kind: BODY_KIND_RIGID")
                .find("rigid"),
            std::string::npos);
  EXPECT_NE(first("tet_mesh { file: 'x' } tetrahedra { cells: 2 }").find("of its own"),
            std::string::npos);
  EXPECT_NE(first("sheet { length_m: 1 width_m: 1 columns: 2 rows: 2 } tetrahedra { cells: 2 }")
                .find("no inside"),
            std::string::npos);
}

}  // namespace
}  // namespace adhesim
