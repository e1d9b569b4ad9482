#include <gtest/gtest.h>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

constexpr const char* kTable = R"(
bodies:
  - {name: table, sheet: {length_m: 0.2, width_m: 0.2, columns: 21, rows: 21}, mass_kg: 1, fixed: [all: true]}
)";

double MeanHeight(const Engine& engine, int body) {
  const Body& b = engine.model().bodies[body];
  double sum = 0;
  for (int p = b.first_particle; p < b.first_particle + b.particle_count; ++p) {
    sum += engine.state().position_m[p].z();
  }
  return sum / b.particle_count;
}

// Without any strength: what rests on a rigid body must stay on it, although the body's own
// resultant (its support less its weight) points up.
TEST(RigidBodies, CarryWhatLiesOnThem) {
  auto engine = EngineOf(std::string(kTable) + R"(
  - {name: block, kind: rigid, block: {size_m: [0.04, 0.04, 0.01], cells: 4}, mass_kg: 5, position_m: [0, 0, 0.0065]}
  - {name: ball, icosphere: {radius_m: 0.02, subdivisions: 2}, mass_kg: 0.02, position_m: [0.001, 0.002, 0.0335]}
effects:
  - uniform_gravity: {}
  - shape_memory: {stiffness_n_m: 60, damping_n_s_m: 0.02}
  - volume_preservation: {}
  - drag: {rate_per_s: 5}  # it must not roll off
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 0}
)");
  double depth = 0;
  for (int k = 0; k < 20; ++k) {
    StepMany(engine.get(), 100);
    depth = std::max(depth,
                     MeasurePenetration(engine->model(), engine->state().position_m).max_depth_m);
  }
  // The capture distance. Measured: 0.53 mm; sinking through was 9 mm.
  EXPECT_LE(depth, 0.001);
  EXPECT_GT(MeanHeight(*engine, 2), 0.018);  // the block ends at 0.0115, the ball flattens
}

TEST(RigidBodies, StackWithoutStrengthStands) {
  auto engine = EngineOf(std::string(kTable) + R"(
  - {name: a, kind: rigid, block: {size_m: [0.04, 0.04, 0.01], cells: 4}, mass_kg: 2, position_m: [0, 0, 0.0062]}
  - {name: b, kind: rigid, block: {size_m: [0.04, 0.04, 0.01], cells: 4}, mass_kg: 2, position_m: [0.003, 0.002, 0.0174]}
  - {name: c, kind: rigid, block: {size_m: [0.04, 0.04, 0.01], cells: 4}, mass_kg: 0.1, position_m: [0.001, 0, 0.0286]}
effects:
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 0}
)");
  StepMany(engine.get(), 1500);
  EXPECT_NEAR(MeanHeight(*engine, 1), 0.006, 0.001);
  EXPECT_NEAR(MeanHeight(*engine, 2), 0.017, 0.002);
  EXPECT_NEAR(MeanHeight(*engine, 3), 0.028, 0.003);
}

// A rigid block hangs under a fixed plate by its adhesive: it falls if and only if its weight
// exceeds sigma A.
TEST(RigidBodies, HangIfTheirWeightIsBelowTheStrengthOfTheContact) {
  const auto hangs = [](double strength_pa) {
    auto engine = EngineOf(std::string(kTable) + R"(
  - {name: block, kind: rigid, block: {size_m: [0.04, 0.04, 0.04], cells: 4}, mass_kg: 0.5, position_m: [0, 0, -0.0205],
     velocity_m_s: [0, 0, 0.02]}
effects:
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: )" +
                           std::to_string(strength_pa) + "}\n");
    StepMany(engine.get(), 300);
    return !engine->state().contacts.bonds.empty();
  };
  // The block's face, 25 vertices: 16 cm2, and what its edge vertices count of the sides.
  const double weight_pa = 0.5 * 9.81 / 0.0016;
  EXPECT_TRUE(hangs(1.05 * weight_pa));
  EXPECT_FALSE(hangs(0.5 * weight_pa));
}

TEST(RigidBodies, FixedAtTheirBorderHoldLikeAWall) {
  auto engine = EngineOf(R"(
bodies:
  - {name: plate, kind: rigid, sheet: {length_m: 0.2, width_m: 0.2, columns: 21, rows: 21}, mass_kg: 1, fixed: [border: true]}
  - {name: ball, icosphere: {radius_m: 0.02, subdivisions: 2}, mass_kg: 0.02, position_m: [0, 0, 0.025]}
effects:
  - uniform_gravity: {}
  - shape_memory: {stiffness_n_m: 100}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 0}
)");
  StepMany(engine.get(), 1000);
  EXPECT_GT(MeanHeight(*engine, 1), 0.01);
}

TEST(RigidBodies, InitialVelocitiesThatPinsForbidEndBeforeTheBooksOpen) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, kind: rigid, icosphere: {radius_m: 0.05}, mass_kg: 0.5, velocity_m_s: [1, 0, 0],
     fixed: [ball: {centre_m: [0, 0, 0.05], radius_m: 0.01}]}
effects:
  - uniform_gravity: {}
)");
  StepMany(engine.get(), 500);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

// What is fixed, or held by another tool, stops a tool: nothing may be pushed through it.
TEST(Tools, DoNotPushARigidBodyThroughATable) {
  auto engine = EngineOf(std::string(kTable) + R"(
  - {name: block, kind: rigid, block: {size_m: [0.04, 0.04, 0.01], cells: 4}, mass_kg: 0.2, position_m: [0, 0, 0.006]}
tools:
  - name: needle
    needle: {}
    position_m: [0.001, 0.002, 0.02]
    trajectory:
      - {t_s: 0.1, position_m: [0.001, 0.002, 0.02]}
      - {t_s: 0.6, position_m: [0.001, 0.002, -0.02]}
effects:
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
  bool obstructed = false;
  for (int step = 0; step < 1000; ++step) {
    engine->Step({});
    obstructed = obstructed || (engine->state().tools[0].flags & kToolObstructed);
  }
  EXPECT_TRUE(obstructed);
  EXPECT_GT(MeanHeight(*engine, 1), 0.004);
  EXPECT_GT(engine->state().tools[0].pose.position_m.z(), 0.009);  // on the block's upper face
}

TEST(Tools, AreStoppedByTheFixedPartOfASoftBody) {
  auto engine = EngineOf(R"(
bodies:
  - {name: sheet, sheet: {length_m: 0.1, width_m: 0.1, columns: 11, rows: 11}, mass_kg: 0.1,
     fixed: [half_space: {point_m: [0.005, 0, 0], normal: [1, 0, 0]}]}
tools:
  - name: needle
    needle: {}
    position_m: [-0.024, 0.003, 0.02]
    trajectory:
      - {t_s: 0, position_m: [-0.024, 0.003, 0.02]}
      - {t_s: 0.3, position_m: [-0.024, 0.003, -0.03]}
effects:
  - shape_memory: {stiffness_n_m: 50}
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
  StepMany(engine.get(), 600);
  EXPECT_GT(engine->state().tools[0].pose.position_m.z(), -0.001);
}

TEST(Tools, DoNotPassThroughEachOther) {
  for (const int rate_hz : {50, 200, 1000}) {
    auto engine = EngineOf("rate_hz: " + std::to_string(rate_hz) + R"(
bodies:
  - {name: far, icosphere: {radius_m: 0.1}, mass_kg: 1, position_m: [0, 0, 9]}
tools:
  - name: left
    needle: {}
    position_m: [-0.03, 0, 0]
    trajectory: [{t_s: 0, position_m: [-0.03, 0, 0]}, {t_s: 0.12, position_m: [0.03, 0, 0]}]
  - name: right
    needle: {}
    position_m: [0.03, 0, 0]
    trajectory: [{t_s: 0, position_m: [0.03, 0, 0]}, {t_s: 0.12, position_m: [-0.03, 0, 0]}]
)");
    StepMany(engine.get(), rate_hz);
    const double gap =
        engine->state().tools[1].pose.position_m.x() - engine->state().tools[0].pose.position_m.x();
    EXPECT_GE(gap, 0.003 - 1e-6) << rate_hz;  // two shafts of 1.5 mm radius
  }
}

}  // namespace
}  // namespace adhesim::test
