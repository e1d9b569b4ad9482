// Tissue at rest: one matrix for all of it, so that all of it sleeps or none.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/model/diagnostics.h"
#include "tests/support/count_allocations.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

constexpr char kSleep[] = "sleep: {speed_m_s: 0.002, time_s: 0.1}\n";
// The tool comes near after 2 s, and is gone again from 3 s on.
constexpr int kBefore = 380, kTouched = 640, kEnd = 1200;

// Two blocks that sink under their weight, far from each other, and a probe that presses into one,
// sticks and is pulled off.
std::string Blocks(const std::string& sleep, const std::string& damping = "0.02") {
  return R"(
rate_hz: 200
bodies:
  - {name: touched, block: {size_m: [0.04, 0.04, 0.04]}, tetrahedra: {cells: 3}, density_kg_m3: 1000,
     fixed: [half_space: {point_m: [0, 0, -0.0199], normal: [0, 0, 1]}]}
  - {name: other, block: {size_m: [0.04, 0.04, 0.04]}, tetrahedra: {cells: 2}, density_kg_m3: 1000,
     position_m: [0.2, 0, 0], fixed: [half_space: {point_m: [0, 0, -0.0199], normal: [0, 0, 1]}]}
tools:
  - name: probe
    needle: {length_m: 0.1, radius_m: 0.004, tip_length_m: 0.004}
    position_m: [0.001, 0.002, 0.03]
    adhesion: {normal_strength_pa: 1500}
    trajectory:
      - {t_s: 0, position_m: [0.001, 0.002, 0.03]}
      - {t_s: 1.9, position_m: [0.001, 0.002, 0.03]}
      - {t_s: 2.1, position_m: [0.001, 0.002, 0.015]}
      - {t_s: 2.4, position_m: [0.001, 0.002, 0.015]}
      - {t_s: 3, position_m: [0.001, 0.002, 0.03]}
effects:
  - elasticity: {young_modulus_pa: 4000, poisson_ratio: 0.4, stiffness_damping_s: )" +
         damping + R"(}
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001}
)" + sleep;
}

TEST(SleepingTissue, FallsAsleepAndWakesAllOfIt) {
  auto engine = EngineOf(Blocks(kSleep));
  StepMany(engine.get(), kBefore);
  ASSERT_EQ(engine->state().sleep.bodies, 2);
  const std::vector<Vec3> at_rest = engine->state().position_m;
  bool other_moved = false;
  for (int k = kBefore; k < kTouched; ++k) {
    engine->Step({});
    const int asleep = engine->state().sleep.bodies;
    EXPECT_TRUE(asleep == 0 || asleep == 2) << asleep;
    other_moved = other_moved || (engine->state().position_m.back() - at_rest.back()).norm() > 0;
  }
  EXPECT_TRUE(other_moved);  // it was awake, with the one that was touched
  StepMany(engine.get(), kEnd - kTouched);
  EXPECT_EQ(engine->state().sleep.bodies, 2);
  const Vec3 velocity = engine->state().velocity_m_s.front();
  EXPECT_EQ(velocity.norm(), 0);
}

// What it lost when it fell asleep is less than 2 mm/s of motion, and the static solution is the
// same: forces differ by less than 1 % of the peak.
TEST(SleepingTissue, AnswersLikeTissueThatNeverSlept) {
  auto sleeps = EngineOf(Blocks(kSleep)), never = EngineOf(Blocks(""));
  StepMany(sleeps.get(), kBefore);
  StepMany(never.get(), kBefore);
  const double elastic_j = never->state().ledger.elastic_j;
  EXPECT_NEAR(sleeps->state().ledger.elastic_j, elastic_j, 0.01 * elastic_j);
  double peak_n = 0, apart_n = 0, bar_n = -1;
  for (int k = kBefore; k < kTouched; ++k) {
    sleeps->Step({});
    never->Step({});
    const Vec3 force = never->state().tools[0].tissue.force_n;
    peak_n = std::max(peak_n, force.norm());
    apart_n = std::max(apart_n, (sleeps->state().tools[0].tissue.force_n - force).norm());
    bar_n = std::max(bar_n, sleeps->MakeFrame().tools[0].force_error_n);
  }
  EXPECT_GT(peak_n, 0.05);
  EXPECT_LT(apart_n, 0.01 * peak_n);
  EXPECT_GT(bar_n, 0);  // bars are there again once it is awake
}

// Through honey tissue sinks for seconds, slower than is asked for: by its speed alone it would
// fall asleep half way down, at half of its elastic energy.
TEST(SleepingTissue, CreepsToItsBalanceBeforeItSleeps) {
  const auto honey = [](const std::string& sleep) {
    return EngineOf(R"(
rate_hz: 200
bodies:
  - {name: a, block: {size_m: [0.04, 0.04, 0.04]}, tetrahedra: {cells: 2}, density_kg_m3: 1000,
     fixed: [half_space: {point_m: [0, 0, -0.0199], normal: [0, 0, 1]}]}
effects:
  - elasticity: {young_modulus_pa: 1000, poisson_ratio: 0.4}
  - uniform_gravity: {}
  - drag: {rate_per_s: 2000}
)" + sleep);
  };
  auto sleeps = honey(kSleep), never = honey("");
  const int steps = 2000;
  StepMany(never.get(), steps);
  int awake = 0;
  while (sleeps->state().sleep.bodies == 0 && awake < steps) {
    sleeps->Step({});
    ++awake;
  }
  EXPECT_LT(awake, steps);
  const double elastic_j = never->state().ledger.elastic_j;
  EXPECT_NEAR(sleeps->state().ledger.elastic_j, elastic_j, 0.05 * elastic_j);
}

TEST(SleepingTissue, BooksWhatItTakes) {
  auto engine = EngineOf(Blocks(kSleep));
  StepMany(engine.get(), kEnd);
  EXPECT_EQ(engine->state().sleep.bodies, 2);
  EXPECT_GT(engine->state().ledger.captured_j, 0);
  EXPECT_GT(engine->state().sleep.elastic_j, 0);  // it has sunk
  EXPECT_LT(IdentityError(engine->state().ledger), 1e-9);
  EXPECT_LT(MomentumBalance(engine->model(), engine->state()).linear, 1e-9);
}

// Also of undamped tissue, whose stiffness lags behind: it swings too long to sleep by itself, and
// sleeps here as soon as it is slow for an instant.
TEST(SleepingTissue, GivesTheSameBitsForAnyThreadsAndAfterRestoring) {
  for (const char* damping : {"0.02", "0"}) {
    const std::string scene = Blocks("sleep: {speed_m_s: 0.02, time_s: 0.005}\n", damping);
    auto engine = EngineOf(scene), two = EngineOf(scene, 2);
    bool slept = false;
    for (int k = 0; k < 9; ++k) {
      const State snapshot = engine->state();
      StepMany(engine.get(), 67);
      StepMany(two.get(), 67);
      const std::uint64_t hash = engine->StateHash();
      EXPECT_EQ(two->StateHash(), hash);
      slept = slept || snapshot.sleep.bodies > 0;
      engine->Restore(snapshot);
      StepMany(engine.get(), 67);
      EXPECT_EQ(engine->StateHash(), hash);
    }
    EXPECT_TRUE(slept);
  }
}

// Where stiffness of the sub-step before serves again, that of before its sleep does not.
TEST(SleepingTissue, WakesWithStiffnessOfItsOwnWhateverWasGivenUp) {
  for (const char* time : {"0.1", "0.105"}) {
    auto engine =
        EngineOf(Blocks(std::string("sleep: {speed_m_s: 0.002, time_s: ") + time + "}\n"));
    ASSERT_EQ(engine->rungs().back().name, std::string("stiffness"));
    engine->SetFidelity(static_cast<int>(engine->rungs().size()));
    StepMany(engine.get(), kBefore);
    const State asleep = engine->state();
    ASSERT_EQ(asleep.sleep.bodies, 2);
    StepMany(engine.get(), kTouched - kBefore);
    const std::uint64_t hash = engine->StateHash();
    engine->Restore(asleep);
    StepMany(engine.get(), kTouched - kBefore);
    EXPECT_EQ(engine->StateHash(), hash);
  }
}

// One block hangs on what is fixed; a cube in a weak field is slow for 0.4 s at the top of its
// flight.
TEST(SleepingTissue, StaysAwakeWhileSomethingFlies) {
  std::string scene = Blocks(kSleep);
  const std::string tools = "tools:";
  scene.insert(scene.find(tools),
               R"(  - {name: flier, block: {size_m: [0.04, 0.04, 0.04]}, tetrahedra: {cells: 1},
     density_kg_m3: 1000, position_m: [0.4, 0, 0], velocity_m_s: [0, 0, 0.005]}
)");
  const std::string gravity = "uniform_gravity: {}";
  scene.replace(scene.find(gravity), gravity.size(),
                "uniform_gravity: {acceleration_m_s2: [0, 0, -0.01]}");
  auto engine = EngineOf(scene);
  double least_m_s = 1;
  for (int k = 0; k < 200; ++k) {
    engine->Step({});
    least_m_s = std::min(least_m_s, engine->state().velocity_m_s.back().norm());
    ASSERT_EQ(engine->state().sleep.bodies, 0) << k;
  }
  EXPECT_LT(least_m_s, 1e-4);
}

TEST(SleepingTissue, AllocatesNothing) {
  auto engine = EngineOf(Blocks(kSleep));
  const long before = allocations;
  StepMany(engine.get(), kTouched);
  EXPECT_EQ(allocations, before);
}

// Explicit steps leave elasticity out as a whole, too.
TEST(SleepingTissue, SleepsInExplicitStepsToo) {
  auto engine =
      EngineOf("integration: {integrator: INTEGRATOR_EXPLICIT}\n" + Blocks(kSleep, "0.002"));
  StepMany(engine.get(), kBefore);
  EXPECT_EQ(engine->state().sleep.bodies, 2);
  StepMany(engine.get(), 60);
  EXPECT_EQ(engine->state().sleep.bodies, 0);  // a tool is near
  EXPECT_LT(IdentityError(engine->state().ledger), 1e-9);
}

}  // namespace
}  // namespace adhesim::test
