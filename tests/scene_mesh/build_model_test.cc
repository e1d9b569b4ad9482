#include "core/scene/build_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "core/scene/place_body.h"
#include "tests/support/scene_of_text.h"

namespace adhesim {
namespace {

using test::SceneOfText;

BuiltModel Build(const std::string& text) { return BuildModel(SceneOfText(text), "."); }

// The model of a scene without problems.
std::shared_ptr<const Model> ModelOf(const std::string& text) {
  const BuiltModel built = Build(text);
  for (const Problem& p : built.problems) ADD_FAILURE() << p.path << ": " << p.message;
  return built.model;
}

// The scene must fail with this one problem.
void ExpectProblem(const std::string& text, const std::string& path, const std::string& part) {
  const BuiltModel built = Build(text);
  EXPECT_EQ(built.model, nullptr);
  ASSERT_EQ(built.problems.size(), 1u);
  EXPECT_EQ(built.problems[0].path, path);
  EXPECT_NE(built.problems[0].message.find(part), std::string::npos) << built.problems[0].message;
}

constexpr char kTwoBodies[] = R"(
  name: "pair"
  bodies { name: "cell" icosphere { radius_m: 0.01 } mass_kg: 0.004 position_m: [0.1, 0.2, 0.3] }
  bodies { name: "plate" sheet { length_m: 0.2 width_m: 0.1 columns: 3 rows: 3 } mass_kg: 0.5
           kind: BODY_KIND_RIGID fixed { all: true } })";

TEST(BuildModel, LaysBodiesOutOneAfterTheOther) {
  const auto model = ModelOf(kTwoBodies);
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->name, "pair");
  ASSERT_EQ(model->bodies.size(), 2u);
  const Body& cell = model->bodies[0];
  const Body& plate = model->bodies[1];
  EXPECT_EQ(cell.particle_count, 42);  // the default of one subdivision
  EXPECT_EQ(cell.triangle_count, 80);
  EXPECT_EQ(plate.first_particle, 42);
  EXPECT_EQ(plate.first_triangle, 80);
  EXPECT_TRUE(cell.closed);
  EXPECT_FALSE(cell.rigid);
  EXPECT_FALSE(cell.all_fixed);
  EXPECT_GT(cell.rest_volume_m3, 0);
  EXPECT_FALSE(plate.closed);
  EXPECT_TRUE(plate.rigid);
  EXPECT_TRUE(plate.all_fixed);
  EXPECT_NEAR(plate.size_m, std::hypot(0.2, 0.1), 1e-16);
  for (int t = 80; t < 88; ++t) {
    for (const int v : model->triangles[t]) EXPECT_TRUE(v >= 42 && v < 51);
  }
  EXPECT_EQ(model->body_of[41], 0);
  EXPECT_EQ(model->body_of[42], 1);
}

TEST(BuildModel, TakesDefaultsThatAreNotWritten) {
  const auto model = ModelOf(kTwoBodies);
  EXPECT_EQ(model->dt_s, 1e-3);
  EXPECT_EQ(model->stability_fraction, 0.5);
  EXPECT_EQ(model->max_substeps, 64);
  EXPECT_EQ(model->seed, 1u);
  EXPECT_FALSE(model->adhesive.has_value());
}

TEST(BuildModel, SpreadsTheMassByArea) {
  const auto model = ModelOf(kTwoBodies);
  const auto begin = model->mass_kg.begin();
  EXPECT_NEAR(std::accumulate(begin, begin + 42, 0.0), 0.004, 1e-17);  // 42 terms: round-off
  EXPECT_NEAR(std::accumulate(begin + 42, model->mass_kg.end(), 0.0), 0.5, 1e-15);
  // The middle of the sheet belongs to six of its eight triangles; each is 1/8 of the area.
  EXPECT_NEAR(model->mass_kg[42 + 4], 0.5 * 6 / 8 / 3, 1e-16);
  EXPECT_NEAR(model->area_m2[42 + 4], 0.02 * 6 / 8 / 3, 1e-17);
}

TEST(BuildModel, ListsNeighboursAndIncidentTrianglesInOrder) {
  const auto model = ModelOf(kTwoBodies);
  const int n = model->particle_count();
  ASSERT_EQ(model->neighbour_start.size(), n + 1u);
  EXPECT_EQ(model->neighbour_start[n], static_cast<int>(model->neighbours.size()));
  EXPECT_EQ(model->incident.size(), 3 * model->triangles.size());
  for (int i = 0; i < n; ++i) {
    const auto first = model->neighbours.begin() + model->neighbour_start[i];
    const auto last = model->neighbours.begin() + model->neighbour_start[i + 1];
    EXPECT_TRUE(std::is_sorted(first, last));
    EXPECT_EQ(std::adjacent_find(first, last), last);
    EXPECT_EQ(std::find(first, last, i), last);
    for (int k = model->incident_start[i]; k < model->incident_start[i + 1]; ++k) {
      const Triangle& t = model->triangles[model->incident[k]];
      EXPECT_NE(std::find(t.begin(), t.end(), i), t.end());
    }
  }
  // Middle of the 3 x 3 sheet: all but the two corners that the diagonals miss.
  const std::vector<int> middle(model->neighbours.begin() + model->neighbour_start[46],
                                model->neighbours.begin() + model->neighbour_start[47]);
  EXPECT_EQ(middle, (std::vector<int>{42, 43, 45, 47, 49, 50}));
}

TEST(BuildModel, TurnsAboutXThenYThenZAndThenMoves) {
  // x about x stays; about y by 90 becomes -z; about z stays.
  EXPECT_EQ(RotationFromDegrees({90, 90, 0}) * Vec3(0, 1, 0), Vec3(1, 0, 0));
  EXPECT_EQ(RotationFromDegrees({0, 90, 90}) * Vec3(1, 0, 0), Vec3(0, 0, -1));
  EXPECT_EQ(RotationFromDegrees({90, 0, 90}) * Vec3(0, 1, 0), Vec3(0, 0, 1));
  const auto model = ModelOf(R"(
    bodies { name: "b" block { size_m: [0.4, 0.2, 0.1] cells: 1 } mass_kg: 1
             rotation_deg: [0, 0, 90] position_m: [1, 2, 3] })");
  Aabb box;
  for (const Vec3& p : model->rest_position_m) box.Add(p);
  EXPECT_TRUE(box.min.isApprox(Vec3(0.9, 1.8, 2.95), 1e-15));
  EXPECT_TRUE(box.max.isApprox(Vec3(1.1, 2.2, 3.05), 1e-15));
}

TEST(BuildModel, TurnsByAnyAngleAsExactlyAsDoublesAllow) {
  for (double degrees = -360; degrees <= 360; degrees += 7.3) {
    const Mat3 r = RotationFromDegrees({0, 0, degrees});
    const double angle = degrees * (3.14159265358979323846 / 180);
    EXPECT_NEAR(r(0, 0), std::cos(angle), 1e-15);  // a few roundings of numbers below 1 and 2 pi
    EXPECT_NEAR(r(1, 0), std::sin(angle), 1e-15);
  }
}

TEST(BuildModel, GivesInitialVelocityToFreeParticlesOnly) {
  const auto model = ModelOf(R"(
    bodies { name: "ball" icosphere { radius_m: 0.5 subdivisions: 2 } mass_kg: 1
             position_m: [3, 0, 0] velocity_m_s: [1, 2, 3] angular_velocity_rad_s: [0, 0, 2]
             fixed { half_space { point_m: [0, 0, -0.2] normal: [0, 0, 5] } } })");
  int fixed = 0;
  for (int i = 0; i < model->particle_count(); ++i) {
    const Vec3 r = model->rest_position_m[i] - Vec3(3, 0, 0);
    EXPECT_EQ(model->fixed[i] == 1, r.z() <= -0.2);
    const Vec3 expected = model->fixed[i] ? Vec3::Zero() : Vec3(1 - 2 * r.y(), 2 + 2 * r.x(), 3);
    // The centre of mass of a symmetric ball, by a sum of 162 terms.
    EXPECT_TRUE((model->initial_velocity_m_s[i] - expected).norm() < 1e-13);
    fixed += model->fixed[i];
  }
  EXPECT_GT(fixed, 0);
  EXPECT_FALSE(model->bodies[0].all_fixed);
}

TEST(BuildModel, FixesTheUnionOfRegions) {
  const auto model = ModelOf(R"(
    bodies { name: "s" sheet { length_m: 2 width_m: 2 columns: 5 rows: 5 } mass_kg: 1
             fixed { border: true } fixed { ball { centre_m: [0, 0, 0] radius_m: 0.1 } } })");
  EXPECT_EQ(std::accumulate(model->fixed.begin(), model->fixed.end(), 0), 16 + 1);
  EXPECT_EQ(model->fixed[12], 1);
  EXPECT_EQ(model->fixed[6], 0);
}

TEST(BuildModel, RefusesARegionWithoutParticles) {
  ExpectProblem(R"(bodies { name: "s" sheet { length_m: 2 width_m: 2 columns: 5 rows: 5 }
      mass_kg: 1 fixed { border: true } fixed { ball { centre_m: [9, 0, 0] radius_m: 0.1 } } })",
                "bodies[0].fixed[1]",
                "selects no particle of body 's': its particles lie within x -1 to 1, y -1 to 1, "
                "z 0 to 0 m");
  ExpectProblem(R"(bodies { name: "b" icosphere { radius_m: 1 } mass_kg: 1
      fixed { border: true } })",
                "bodies[0].fixed[0]", "closed");
  ExpectProblem(R"(bodies { name: "b" icosphere { radius_m: 1 } mass_kg: 1
      fixed { half_space { point_m: [0, 0, 0] normal: [0, 0, 0] } } })",
                "bodies[0].fixed[0].half_space.normal", "no length");
}

TEST(BuildModel, RefusesCellsOfNoSize) {
  const auto block = [](const std::string& size) {
    return "bodies { name: 'b' block { size_m: [" + size +
           "] } mass_kg: 1 tetrahedra { cells: 1 } }";
  };
  ExpectProblem(block("1e-10, 1e-10, 1e-10"), "bodies[0].block",
                "its shortest edge is 1e-10 m; permitted: at least 1e-07 m");
  EXPECT_NE(ModelOf(block("2e-7, 2e-7, 2e-7")), nullptr);
}

TEST(BuildModel, WarnsOfPatchesSmallerThanTheEdgesThatTheyHoldBy) {
  const auto warnings = [](const std::string& count, const std::string& fixed = "") {
    return Build("bodies { name: 'floor' sheet { length_m: 1 width_m: 1 columns: " + count +
                 " rows: " + count + " } mass_kg: 1 " + fixed +
                 " } effects { virtual_adhesive { "
                 "capture_distance_m: 0.002 normal_strength_pa: 1000 patch_size_m: 0.05 } }")
        .problems;
  };
  EXPECT_TRUE(warnings("13").empty());                        // 83 and 118 mm
  EXPECT_TRUE(warnings("3", "fixed { all: true }").empty());  // ground holds whatever its size
  const Problems problems = warnings("3");
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].path, "effects[0].virtual_adhesive.patch_size_m");
  EXPECT_TRUE(problems[0].warning);
  EXPECT_NE(problems[0].message.find("body 'floor', of which edges are 0.569 m"),
            std::string::npos);
}

TEST(BuildModel, WarnsOfCellsWiderThanATool) {
  const auto warnings = [](int cells) {
    const BuiltModel built = Build(
        "bodies { name: 'b' block { size_m: [0.1, 0.1, 0.1] } mass_kg: 1 tetrahedra { cells: " +
        std::to_string(cells) + " } } tools { name: 'n' needle { radius_m: 0.002 } }");
    EXPECT_NE(built.model, nullptr);
    return built.problems;
  };
  EXPECT_TRUE(warnings(26).empty());  // 3.8 mm; the needle is 4 mm wide
  const Problems problems = warnings(20);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].path, "tools[0]");
  EXPECT_TRUE(problems[0].warning);
  EXPECT_NE(problems[0].message.find("0.004 m wide, is narrower than the cells of body 'b', 0.005"),
            std::string::npos)
      << problems[0].message;
}

TEST(BuildModel, RefusesMoreParticlesThanFit) {
  ExpectProblem(R"(bodies { name: "cell" icosphere { radius_m: 1 } mass_kg: 1 }
      bodies { name: "sheet" mass_kg: 1
               sheet { length_m: 1 width_m: 1 columns: 1000 rows: 1000 } })",
                "bodies[1].sheet", "1000042 particles; at most 1000000");
}

TEST(BuildModel, RefusesABodyWithoutShape) {
  ExpectProblem("bodies { name: 'x' mass_kg: 1 }", "bodies[0]", "no shape");
}

TEST(BuildModel, ReadsTools) {
  const auto model = ModelOf(R"(
    tools { name: "needle" needle { radius_m: 0.001 } position_m: [0, 0, 0.1]
            orientation_wxyz: [0.5, 0, 0, 0.5] adhesion { normal_strength_pa: 300 }
            trajectory { t_s: 0 position_m: [0, 0, 0.1] }
            trajectory { t_s: 1 position_m: [0, 0, 0] orientation_wxyz: [1, 0, 0, 0] } }
    tools { name: "lancet" lancet {} position_m: [0, 1, 0]
            coupling { max_force_n: 3 } })");
  ASSERT_EQ(model->tools.size(), 2u);
  const ToolModel& needle = model->tools[0];
  const auto& shape = std::get<NeedleShape>(needle.shape);
  EXPECT_EQ(shape.length_m, 0.12);
  EXPECT_EQ(shape.radius_m, 0.001);
  EXPECT_NEAR(needle.start.orientation.norm(), 1, 1e-15);
  EXPECT_EQ(needle.strength.shear_pa, 300);
  EXPECT_EQ(needle.coupling.stiffness_n_m, 1000);
  ASSERT_EQ(needle.trajectory.size(), 2u);
  EXPECT_EQ(needle.trajectory[0].pose.orientation.coeffs(), needle.start.orientation.coeffs());
  EXPECT_EQ(needle.trajectory[1].pose.orientation.coeffs(), Quat::Identity().coeffs());
  const ToolModel& lancet = model->tools[1];
  EXPECT_EQ(std::get<LancetShape>(lancet.shape).blade_width_m, 0.006);
  EXPECT_EQ(lancet.strength.normal_pa, 0);
  EXPECT_EQ(lancet.coupling.max_force_n, 3);
}

TEST(BuildModel, RefusesImpossibleTools) {
  ExpectProblem(R"(tools { name: "n" needle {} position_m: [0, 0, 0]
      orientation_wxyz: [0, 0, 0, 0] })",
                "tools[0].orientation_wxyz", "length 0");
  ExpectProblem(R"(tools { name: "n" needle { length_m: 0.001 } position_m: [0, 0, 0] })",
                "tools[0].needle.tip_length_m", "longer");
  ExpectProblem(R"(tools { name: "n" needle {} position_m: [0, 0, 0]
      trajectory { t_s: 1 position_m: [0, 0, 0] } trajectory { t_s: 1 position_m: [0, 0, 1] } })",
                "tools[0].trajectory[1].t_s", "not after");
}

TEST(BuildModel, ReadsTheAdhesive) {
  const double infinite = std::numeric_limits<double>::infinity();
  const auto bare = ModelOf("effects { virtual_adhesive { capture_distance_m: 0.002 } }");
  ASSERT_TRUE(bare->adhesive.has_value());
  EXPECT_EQ(bare->adhesive->release_distance_m, 1.5 * 0.002);
  EXPECT_EQ(bare->adhesive->strength.normal_pa, infinite);
  EXPECT_EQ(bare->adhesive->strength.shear_pa, infinite);
  EXPECT_FALSE(bare->adhesive->kappa.has_value());

  const auto written = ModelOf(R"(effects { virtual_adhesive { capture_distance_m: 0.002
      release_distance_m: 0.005 normal_strength_pa: 40 } })");
  EXPECT_EQ(written->adhesive->release_distance_m, 0.005);
  EXPECT_EQ(written->adhesive->strength.normal_pa, 40);
  EXPECT_EQ(written->adhesive->strength.shear_pa, 40);

  const auto kappa =
      ModelOf("effects { virtual_adhesive { capture_distance_m: 0.002 kappa_adh_m: 1e-5 } }");
  EXPECT_EQ(kappa->adhesive->kappa->kappa_adh_m, 1e-5);
  EXPECT_EQ(kappa->adhesive->kappa->dt_ref_s, 0.001);
}

TEST(BuildModel, RefusesAContradictoryAdhesive) {
  ExpectProblem(R"(effects { virtual_adhesive { capture_distance_m: 0.002
      release_distance_m: 0.002 } })",
                "effects[0].virtual_adhesive.release_distance_m",
                "greater than capture_distance_m");
  ExpectProblem(R"(effects { virtual_adhesive { capture_distance_m: 0.002 kappa_adh_m: 1
      normal_strength_pa: 1 } })",
                "effects[0].virtual_adhesive.kappa_adh_m", "twice");
  ExpectProblem(R"(effects { virtual_adhesive { capture_distance_m: 0.002 } }
      effects { virtual_adhesive { capture_distance_m: 0.002 } })",
                "effects[1].virtual_adhesive", "at most one");
}

TEST(BuildModel, RefusesElasticRegionsWithoutTetrahedra) {
  const std::string block = R"(bodies { name: "b" block { size_m: [0.1, 0.1, 0.1] cells: 2 }
    mass_kg: 1 tetrahedra { cells: 2 } } effects { elasticity { young_modulus_pa: 1000 )";
  const auto region = [&](const std::string& where) {
    return block + "regions { where { " + where + " } young_modulus_pa: 1 } } }";
  };
  EXPECT_NE(Build(region("all: true")).model, nullptr);
  const std::string path = "effects[0].elasticity.regions[0].where";
  ExpectProblem(
      region("ball { centre_m: [3, 0, 0] radius_m: 0.1 }"), path,
      "permitted: those that hold the centre of one, which lie within x -0.0375 to 0.0375");
  ExpectProblem(region("label: 3"), path, "have no labels");
  ExpectProblem(region("group: 'vessel'"), path, "have no groups");
}

TEST(BuildModel, RefusesElasticityOfNoBody) {
  ExpectProblem(R"(bodies { name: "s" icosphere { radius_m: 1 } mass_kg: 1 }
                   effects { elasticity { young_modulus_pa: 1000 } })",
                "effects[0].elasticity", "no body of tetrahedra");
}

TEST(BuildModel, ReportsEveryProblemAtOnce) {
  const BuiltModel built = Build(R"(
    bodies { name: "a" icosphere { radius_m: 1 } mass_kg: 1 fixed { border: true } }
    tools { name: "n" needle {} position_m: [0, 0, 0] orientation_wxyz: [0, 0, 0, 0] }
    effects { virtual_adhesive { capture_distance_m: 0.002 release_distance_m: 0.001 } })");
  EXPECT_EQ(built.problems.size(), 3u);
}

constexpr char kCells[] = R"(
  bodies { name: "cell" icosphere { radius_m: 0.5 } mass_kg: 2 position_m: [1, 2, 3]
           copies { count: 40 radius_m: 4 spacing_m: 1.1 } }
  bodies { name: "other" icosphere { radius_m: 0.5 } mass_kg: 1 position_m: [20, 0, 0] })";

TEST(BuildModel, ScattersCopiesOfABody) {
  const auto model = ModelOf(kCells);
  ASSERT_NE(model, nullptr);
  ASSERT_EQ(model->bodies.size(), 41u);
  EXPECT_EQ(model->bodies[0].name, "cell-1");
  EXPECT_EQ(model->bodies[39].name, "cell-40");
  EXPECT_EQ(model->bodies[39].scene_name, "cell");
  EXPECT_EQ(model->bodies[40].scene_name, "other");
  EXPECT_NEAR(std::accumulate(model->mass_kg.begin(), model->mass_kg.end(), 0.0), 81, 1e-12);
  std::vector<Vec3> centres;
  for (int b = 0; b < 40; ++b) {
    Vec3 sum = Vec3::Zero();
    for (int p = 42 * b; p < 42 * (b + 1); ++p) sum += model->rest_position_m[p];
    centres.push_back(sum / 42);
    EXPECT_LE((centres.back() - Vec3(1, 2, 3)).norm(), 4 + 1e-12);
    for (int other = 0; other < b; ++other) {
      EXPECT_GE((centres[b] - centres[other]).norm(), 1.1 - 1e-12);
    }
  }
  // Turned, each in its own way.
  const auto corner = [&](int b) { return Vec3(model->rest_position_m[42 * b] - centres[b]); };
  EXPECT_GT((corner(0) - corner(1)).norm(), 0.01);
  EXPECT_EQ(ModelOf(kCells)->rest_position_m, model->rest_position_m);
  EXPECT_NE(ModelOf(std::string("seed: 2 ") + kCells)->rest_position_m, model->rest_position_m);
}

TEST(BuildModel, PacksCopiesWithoutARadiusDensely) {
  const auto model = ModelOf(R"(
    bodies { name: "cell" icosphere { radius_m: 0.5 } mass_kg: 2 position_m: [1, 2, 3]
             copies { count: 55 spacing_m: 1 } })");
  ASSERT_NE(model, nullptr);
  ASSERT_EQ(model->bodies.size(), 55u);
  std::vector<Vec3> centres;
  int touching = 0;
  for (int b = 0; b < 55; ++b) {
    Vec3 sum = Vec3::Zero();
    for (int p = 42 * b; p < 42 * (b + 1); ++p) sum += model->rest_position_m[p] / 42;
    centres.push_back(sum);
    for (int other = 0; other < b; ++other) {
      const double distance_m = (centres[b] - centres[other]).norm();
      EXPECT_GE(distance_m, 1 - 1e-12);
      touching += distance_m < 1 + 1e-12;
    }
  }
  // The first shells of the lattice have 1, 12, 6, 24 and 12 points, the last at twice the spacing.
  EXPECT_NEAR((centres[0] - Vec3(1, 2, 3)).norm(), 0, 1e-12);
  EXPECT_NEAR((centres[12] - centres[0]).norm(), 1, 1e-12);
  EXPECT_NEAR((centres[54] - centres[0]).norm(), 2, 1e-12);
  EXPECT_EQ(touching, 216);  // of a cuboctahedron of 55 balls
}

TEST(BuildModel, RefusesCopiesThatFindNoRoom) {
  ExpectProblem(R"(bodies { name: "cell" icosphere { radius_m: 0.5 } mass_kg: 2
                    copies { count: 40 radius_m: 1 spacing_m: 1.1 } })",
                "bodies[0].copies", "of 40 copies");
  ExpectProblem(R"(bodies { name: "cell" icosphere { radius_m: 0.5 subdivisions: 6 } mass_kg: 2
                    copies { count: 1000 radius_m: 100 spacing_m: 1.1 } })",
                "bodies[0].icosphere", "40962000 particles");
}

TEST(BuildModel, GivesTheSameBitsEachTime) {
  const auto first = ModelOf(kTwoBodies), second = ModelOf(kTwoBodies);
  EXPECT_EQ(first->rest_position_m, second->rest_position_m);
  EXPECT_EQ(first->mass_kg, second->mass_kg);
  EXPECT_EQ(first->neighbours, second->neighbours);
}

}  // namespace
}  // namespace adhesim
