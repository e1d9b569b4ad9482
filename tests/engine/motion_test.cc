#include <gtest/gtest.h>

#include "core/model/volume.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

TEST(Motion, FreeFallIsTheDiscreteClosedForm) {
  auto engine = EngineOf(R"(
rate_hz: 1000
bodies:
  - {name: ball, icosphere: {radius_m: 0.1}, mass_kg: 2, position_m: [1, 2, 3], velocity_m_s: [0.3, -0.2, 1]}
effects:
  - uniform_gravity: {acceleration_m_s2: [0, 0, -9.81]}
)");
  const int n = 1000;
  const double dt = 1e-3;
  StepMany(engine.get(), n);
  for (int p = 0; p < engine->model().particle_count(); ++p) {
    // Symplectic Euler: x_n = x_0 + n dt v_0 + g dt^2 n (n + 1) / 2, to the round-off of n
    // additions.
    const Vec3 expected = engine->model().rest_position_m[p] + n * dt * Vec3(0.3, -0.2, 1) +
                          Vec3(0, 0, -9.81) * dt * dt * n * (n + 1) / 2;
    EXPECT_LT((engine->state().position_m[p] - expected).norm(), 1e-12);
    EXPECT_LT((engine->state().velocity_m_s[p] - Vec3(0.3, -0.2, 1 - 9.81 * n * dt)).norm(), 1e-12);
  }
}

TEST(Motion, RestStaysAtRest) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.1, subdivisions: 2}, mass_kg: 1}
  - {name: sheet, sheet: {length_m: 1, width_m: 1, columns: 8, rows: 8}, mass_kg: 1, position_m: [0, 0, -0.12]}
effects:
  - shape_memory: {stiffness_n_m: 100}
  - volume_preservation: {}
  - drag: {rate_per_s: 1}
  - virtual_adhesive: {capture_distance_m: 0.002, normal_strength_pa: 10}
)");
  EXPECT_EQ(StepMany(engine.get(), 2000), 0u);
  for (int p = 0; p < engine->model().particle_count(); ++p) {
    // Nothing holds the bodies: 2000 steps of round-off forces let them drift.
    EXPECT_LT((engine->state().position_m[p] - engine->model().rest_position_m[p]).norm(), 1e-13);
  }
  EXPECT_EQ(engine->state().contacts.bonds.size(), 0u);
}

TEST(Motion, RigidMotionOfAnElasticBodyStaysRigidAndFree) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.1, subdivisions: 1}, mass_kg: 1, position_m: [0, 0, 5], velocity_m_s: [1, 2, 3]}
effects:
  - shape_memory: {stiffness_n_m: 100}
  - volume_preservation: {}
)");
  StepMany(engine.get(), 1000);
  for (int p = 0; p < engine->model().particle_count(); ++p) {
    EXPECT_LT(
        (engine->state().position_m[p] - engine->model().rest_position_m[p] - Vec3(1, 2, 3)).norm(),
        1e-12);
  }
}

TEST(Motion, FixedParticlesDoNotMove) {
  auto engine = EngineOf(R"(
bodies:
  - name: sheet
    sheet: {length_m: 1, width_m: 1, columns: 8, rows: 8}
    mass_kg: 1
    fixed: [border: true]
effects:
  - shape_memory: {stiffness_n_m: 100}
  - uniform_gravity: {}
)");
  StepMany(engine.get(), 500);
  int fixed = 0;
  double lowest = 0;
  for (int p = 0; p < engine->model().particle_count(); ++p) {
    lowest = std::min(lowest, engine->state().position_m[p].z());
    if (!engine->model().fixed[p]) continue;
    ++fixed;
    EXPECT_EQ(engine->state().position_m[p], engine->model().rest_position_m[p]);
  }
  EXPECT_EQ(fixed, 28);
  EXPECT_LT(lowest, -0.01);
}

TEST(Motion, VolumeIsExactInEveryStepOfABodyThatIsHitAndSpins) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1, position_m: [0, 0, 0.6],
     velocity_m_s: [0, 0, -2], angular_velocity_rad_s: [1, 2, -3]}
  - {name: floor, sheet: {length_m: 4, width_m: 4, columns: 9, rows: 9}, mass_kg: 1, fixed: [all: true]}
effects:
  - shape_memory: {stiffness_n_m: 20}
  - volume_preservation: {}
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.01, normal_strength_pa: 0}
)");
  const Body& ball = engine->model().bodies[0];
  double worst = 0, least_height = 1;
  for (int step = 0; step < 1500; ++step) {
    EXPECT_EQ(engine->Step({}).bits, 0u);
    const double volume = EnclosedVolume(engine->model(), ball, engine->state().position_m);
    worst = std::max(worst, std::abs(volume / ball.rest_volume_m3 - 1));
    double low = 1e9, high = -1e9;
    for (int p = 0; p < ball.particle_count; ++p) {
      low = std::min(low, engine->state().position_m[p].z());
      high = std::max(high, engine->state().position_m[p].z());
    }
    least_height = std::min(least_height, high - low);
  }
  EXPECT_LT(worst, 1e-12);        // the solver's own tolerance is 1e-13
  EXPECT_LT(least_height, 0.95);  // it was really squeezed
}

TEST(Motion, TooStiffASceneIsRefusedWithTheSubstepsItNeeds) {
  const auto model = ModelOf(R"(
rate_hz: 100
bodies:
  - {name: ball, icosphere: {radius_m: 0.1}, mass_kg: 0.001}
effects:
  - shape_memory: {stiffness_n_m: 100000}
)");
  const auto engine = Engine::Create(model, {});
  ASSERT_FALSE(engine.ok());
  EXPECT_EQ(engine.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(engine.status().message().find("sub-steps"), std::string::npos) << engine.status();
}

}  // namespace
}  // namespace adhesim::test
