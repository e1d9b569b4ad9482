#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

int EdgeBonds(const Engine& engine) {
  return static_cast<int>(std::ranges::count_if(
      engine.state().contacts.bonds, [](const Bond& bond) { return bond.partner >= 0; }));
}

std::string Numbers(const Vec3& v) {
  return "[" + std::to_string(v.x()) + ", " + std::to_string(v.y()) + ", " + std::to_string(v.z()) +
         "]";
}

// Spheres of 42 vertices have edges as long as 0.6 radii: thrown at each other at any angle and
// spinning, they meet with edges as often as with vertices.
TEST(EdgeContact, CoarseSpheresThrownAtEachOtherNeverInterlock) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] {  // one after the other: the order of arguments is the compiler's
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    return Vec3(x, y, z);
  };
  int met = 0, by_edges = 0;
  for (int seed = 0; seed < (kSanitized ? 8 : TestSize(60, 1000)); ++seed) {
    const Vec3 direction = vector().normalized();
    const Vec3 aside = 0.6 * direction.cross(vector());
    std::string scene = "bodies:\n";
    for (const double side : {1.0, -1.0}) {
      scene += side > 0 ? "  - {name: a" : "  - {name: b";
      scene += ", icosphere: {radius_m: 0.6}, mass_kg: 1, rotation_deg: " + Numbers(180 * vector());
      scene += ", angular_velocity_rad_s: " + Numbers(5 * vector());
      scene += ", position_m: " + Numbers(side * (0.63 * direction + aside));
      scene += ", velocity_m_s: " + Numbers(-4 * side * direction) + "}\n";
    }
    auto engine = EngineOf(scene + R"(
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 1}
)");
    int edges = 0;
    for (int k = 0; k < 40; ++k) {
      StepMany(engine.get(), 10);
      edges = std::max(edges, EdgeBonds(*engine));
      const std::vector<Vec3>& x = engine->state().position_m;
      const Penetration now = MeasurePenetration(engine->model(), x);
      ASSERT_EQ(now.vertices_inside, 0)
          << "seed " << seed << " step " << 10 * k << " depth " << now.max_depth_m;
      ASSERT_EQ(CountEdgesThrough(engine->model(), x), 0) << "seed " << seed << " step " << 10 * k;
    }
    met += engine->state().contacts.next_zone_id > 0;
    by_edges += edges > 0;
    EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  }
  // They pass each other in a quarter of the throws.
  EXPECT_GT(met, kSanitized ? 2 : 30);
  EXPECT_GT(by_edges, kSanitized ? 1 : 20);
}

// A block on its edge over another on its edge, at right angles: nothing but two edges can meet.
std::string CrossedBlocks(const std::string& kind, double strength_pa, double pull_m_s2,
                          bool swapped) {
  std::string a = "  - {name: a, kind: " + kind +
                  ", block: {size_m: [1, 1, 1], cells: 2}, mass_kg: 1, rotation_deg: [45, 0, 0], "
                  "position_m: [0.13, 0.21, 0.72], velocity_m_s: [0, 0, -1]}\n";
  const std::string b = "  - {name: b, kind: " + kind +
                        ", block: {size_m: [1, 1, 1], cells: 2}, mass_kg: 1, rotation_deg: [0, 45, "
                        "0], position_m: [0, 0, -0.72], velocity_m_s: [0, 0, 1]}\n";
  const std::string pull = ", acceleration_m_s2: " + std::to_string(pull_m_s2) + "}\n";
  return "bodies:\n" + (swapped ? b + a : a + b) + "effects:\n" +
         (kind == "rigid" ? "" : "  - shape_memory: {stiffness_n_m: 200}\n") +
         "  - attraction: {bodies: [a], point_m: [0, 0, 100]" + pull +
         "  - attraction: {bodies: [b], point_m: [0, 0, -100]" + pull +
         "  - virtual_adhesive: {capture_distance_m: 0.01, normal_strength_pa: " +
         std::to_string(strength_pa) + ", shear_strength_pa: 1e9}\n";
}

TEST(EdgeContact, CrossedEdgesAreCapturedAtTheCaptureDistanceAndHold) {
  auto engine = EngineOf(CrossedBlocks("rigid", 1e6, 0, false));
  StepMany(engine.get(), 300);
  const Contacts& contacts = engine->state().contacts;
  ASSERT_EQ(contacts.bonds.size(), 1u);
  EXPECT_EQ(EdgeBonds(*engine), 1);
  EXPECT_LT(contacts.bonds[0].gap_m, 0.01);
  EXPECT_GE(contacts.bonds[0].gap_m, 0.005);  // nothing crosses half of it in a sub-step
  EXPECT_EQ(CountEdgesThrough(engine->model(), engine->state().position_m), 0);
}

// A needle holds both blocks, whose edges therefore need no looking at. It lets go of them under
// forces that would drive one edge 0.85 mm through the other in that same step.
TEST(EdgeContact, EdgesThatMovedAsOneAreLookedAtInTheStepThatPartsThem) {
  auto engine = EngineOf(R"(
bodies:
  - {name: a, kind: rigid, block: {size_m: [0.02, 0.02, 0.02]}, mass_kg: 0.01,
     rotation_deg: [45, 0, 0], position_m: [0.00414, 0, 0.014292], velocity_m_s: [0.01, 0, 0]}
  - {name: b, kind: rigid, block: {size_m: [0.02, 0.02, 0.02]}, mass_kg: 0.01,
     rotation_deg: [0, 45, 0], position_m: [0, 0, -0.014142], velocity_m_s: [0.01, 0, 0]}
tools:
  - {name: holds, needle: {radius_m: 0.002}, position_m: [0.01664, 0, -0.03],
     adhesion: {normal_strength_pa: 1e9}}
effects:
  - attraction: {bodies: [a], point_m: [0, 0, -100], acceleration_m_s2: 500}
  - attraction: {bodies: [b], point_m: [0, 0, 100], acceleration_m_s2: 500}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 1}
)");
  StepMany(engine.get(), 5);
  const Contacts& contacts = engine->state().contacts;
  ASSERT_EQ(contacts.zones.size(), 1u);
  ASSERT_EQ(contacts.zones[0].bodies, 2);
  ASSERT_EQ(EdgeBonds(*engine), 0);
  ToolInput retracted;
  retracted.retracted = true;
  engine->Step(std::span(&retracted, 1));
  EXPECT_EQ(EdgeBonds(*engine), 1);
  EXPECT_EQ(CountEdgesThrough(engine->model(), engine->state().position_m), 0);
}

TEST(EdgeContact, CrossedEdgesPartAtTheirStrength) {
  auto measured = EngineOf(CrossedBlocks("rigid", 1e6, 0, false));
  StepMany(measured.get(), 30);
  const Model& model = measured->model();
  ASSERT_EQ(measured->state().contacts.bonds.size(), 1u);
  double area_m2[2] = {0, 0};
  measured->state().contacts.bonds[0].ForEachMember(
      [&](int p) { area_m2[model.body_of[p]] += model.area_m2[p]; });
  // Each block of 1 kg is pulled by 2 N; 2 % is what the issue grants to strengths.
  const double critical_pa = 2 / std::min(area_m2[0], area_m2[1]);
  const auto holds = [](double strength_pa) {
    auto engine = EngineOf(CrossedBlocks("rigid", strength_pa, 2, false));
    int captures = 0;
    for (int k = 0; k < 300; ++k) captures += engine->Step({}).captures;
    EXPECT_GT(captures, 0);
    return !engine->state().contacts.bonds.empty();
  };
  EXPECT_TRUE(holds(1.02 * critical_pa));
  EXPECT_FALSE(holds(0.98 * critical_pa));
}

TEST(EdgeContact, DoesNotDependOnTheOrderOfBodies) {
  auto first = EngineOf(CrossedBlocks("deformable", 1e6, 0, false));
  auto second = EngineOf(CrossedBlocks("deformable", 1e6, 0, true));
  StepMany(first.get(), 100);
  StepMany(second.get(), 100);
  EXPECT_GT(EdgeBonds(*first), 0);
  const std::vector<Vec3>&x = first->state().position_m, &y = second->state().position_m;
  const std::size_t half = x.size() / 2;
  double furthest_m = 0;
  for (std::size_t p = 0; p < half; ++p) {
    furthest_m = std::max({furthest_m, (x[p] - y[half + p]).norm(), (x[half + p] - y[p]).norm()});
  }
  EXPECT_LT(furthest_m, 1e-9);  // round-off of sums in another order, 100 steps of it
}

// Without edges two to four particles end up inside.
TEST(EdgeContact, SpheresStayOutOfASheetSixTimesAsStiff) {
  if (kSanitized) GTEST_SKIP() << "a long run of what shorter tests do";
  SceneFile file = ReadSceneFile(ADHESIM_SOURCE_DIR "/scenes/paper/six_spheres_on_plane.yaml");
  file.scene.mutable_effects(1)->mutable_shape_memory()->set_stiffness_n_m(2400);
  auto engine = EngineOf(ModelOf(file));
  for (int k = 0; k < 12; ++k) {
    EXPECT_EQ(StepMany(engine.get(), 250), 0u);
    const std::vector<Vec3>& x = engine->state().position_m;
    EXPECT_EQ(MeasurePenetration(engine->model(), x).vertices_inside, 0);
    EXPECT_EQ(CountEdgesThrough(engine->model(), x), 0);
  }
}

}  // namespace
}  // namespace adhesim::test
