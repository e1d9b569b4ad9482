#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"

// What the virtual adhesive is claimed to do, beyond single rules.
namespace adhesim::test {
namespace {

Vec3 Centre(const Engine& engine, int body) {
  const Body& b = engine.model().bodies[body];
  Vec3 sum = Vec3::Zero();
  double mass = 0;
  for (int p = b.first_particle; p < b.first_particle + b.particle_count; ++p) {
    sum += engine.model().mass_kg[p] * engine.state().position_m[p];
    mass += engine.model().mass_kg[p];
  }
  return sum / mass;
}

// A ball hangs on its adhesive below another that is held: it neither creeps nor lets go, and a tap
// at half time decays. An hour at full size, a minute in the gate.
TEST(Claims, AHangingBodyDoesNotCreep) {
  if (kSanitized) GTEST_SKIP() << "a long run of what shorter tests do";
  auto engine = EngineOf(R"(
rate_hz: 1000
bodies:
  - {name: held, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, 0, 0.604], fixed: [half_space: {point_m: [0, 0, 0.5], normal: [0, 0, -1]}]}
  - {name: hanging, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, 0, -0.604], velocity_m_s: [0, 0, 0.5]}
effects:
  - shape_memory: {stiffness_n_m: 60, damping_n_s_m: 0.5}
  - volume_preservation: {}
  - drag: {rate_per_s: 2}
  - uniform_gravity: {acceleration_m_s2: [0, 0, -1]}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 1000}
)");
  ASSERT_EQ(engine->model().particle_count(), 84);
  const int half_s = TestSize(30, 1800);
  const int settling_s = 15;
  StepMany(engine.get(), settling_s * 1000);
  ASSERT_GT(engine->state().contacts.colliding_particles, 0);
  const Vec3 start = Centre(*engine, 1);
  EXPECT_EQ(StepMany(engine.get(), (half_s - settling_s) * 1000), 0u);
  const double size_m = engine->model().bodies[1].size_m;
  EXPECT_LE((Centre(*engine, 1) - start).norm(), 1e-6 * size_m);

  // A tap: 1 mm/s of the whole body.
  State tapped = engine->state();
  for (int p = 42; p < 84; ++p) {
    if (tapped.contacts.zone_of[p] < 0) tapped.velocity_m_s[p].x() += 1e-3;
  }
  engine->Restore(tapped);
  StepMany(engine.get(), 100);
  EXPECT_GT((Centre(*engine, 1) - start).norm(), 1e-6 * size_m);
  EXPECT_EQ(StepMany(engine.get(), half_s * 1000 - 100), 0u);
  EXPECT_LE((Centre(*engine, 1) - start).norm(), 1e-6 * size_m);
  EXPECT_GT(engine->state().contacts.colliding_particles, 0);
}

// The force at which a needle's grip on tissue lets go does not depend on the step.
TEST(Claims, HalvingTheStepKeepsTheReleaseForce) {
  const auto pull_off_n = [](int rate_hz) {
    std::string scene = NeedleScene(kPressAndPull);
    const std::string rate = "rate_hz: 1000";
    scene.replace(scene.find(rate), rate.size(), "rate_hz: " + std::to_string(rate_hz));
    auto engine = EngineOf(scene);
    double pull = 0;
    for (int step = 0; step < 1.3 * rate_hz; ++step) {
      engine->Step({});
      pull = std::max(pull, -engine->state().tools[0].tissue.force_n.z());
    }
    EXPECT_TRUE(engine->state().contacts.bonds.empty());
    return pull;
  };
  const double at_1_ms = pull_off_n(1000), at_half = pull_off_n(2000),
               at_quarter = pull_off_n(4000);
  EXPECT_GT(at_1_ms, 0.05);
  EXPECT_NEAR(at_half, at_1_ms, 0.02 * at_1_ms);
  EXPECT_NEAR(at_quarter, at_half, 0.02 * at_half);
}

// The order in which a scene names its bodies changes round-off, nothing else.
TEST(Claims, TheOrderOfBodiesDoesNotMatter) {
  const std::string a =
      "  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.2, 0, 0.62], "
      "velocity_m_s: [0, 0, -1]}\n";
  const std::string b =
      "  - {name: b, icosphere: {radius_m: 0.5}, mass_kg: 2, position_m: [-0.2, 0.1, -0.6], "
      "velocity_m_s: [0, 0, 1]}\n";
  const auto run = [](const std::string& bodies) {
    auto engine = EngineOf("bodies:\n" + bodies + R"(
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 3}
)");
    const ContactCounts counts = CountContacts(engine.get(), 600);
    EXPECT_GT(counts.captures, 4);
    EXPECT_GT(counts.releases, 4);
    std::pair<Vec3, Vec3> centres{Centre(*engine, 0), Centre(*engine, 1)};
    if (engine->model().bodies[0].name == "b") std::swap(centres.first, centres.second);
    return centres;
  };
  const auto first = run(a + b), second = run(b + a);
  // 1e-16 of a metre, a thousand times larger for each of some e-foldings of an impact.
  EXPECT_LT((first.first - second.first).norm(), 1e-9);
  EXPECT_LT((first.second - second.second).norm(), 1e-9);
}

}  // namespace
}  // namespace adhesim::test
