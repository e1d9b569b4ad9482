#include <gtest/gtest.h>

#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

TEST(Ledger, BalancesThroughCaptureMergeSplitAndRelease) {
  auto engine = EngineOf(kChurningCells);
  const int steps = TestSize(3000, 10000);
  int captures = 0, releases = 0, merges = 0, splits = 0;
  std::size_t zones = 0;
  double captured = 0;
  for (int step = 0; step < steps; ++step) {
    const StepReport report = engine->Step({});
    // Passes that go on into the next step are allowed: they are counted, not lost.
    ASSERT_EQ(report.bits & ~static_cast<std::uint32_t>(kStepReleasePasses), 0u) << step;
    captures += report.captures;
    releases += report.releases;
    const std::size_t now = engine->state().contacts.zones.size();
    merges += report.releases == 0 && now < zones;
    splits += report.captures == 0 && now > zones;
    zones = now;
    EXPECT_GE(engine->state().ledger.captured_j, captured);  // capture only ever takes energy
    captured = engine->state().ledger.captured_j;
  }
  EXPECT_GT(captures, 100);
  EXPECT_GT(releases, 100);
  EXPECT_GT(merges, 0);
  EXPECT_GT(splits, 0);
  const Ledger& ledger = engine->state().ledger;
  EXPECT_LE(IdentityError(ledger), 1e-12);  // demanded: 1e-9; round-off of 252 particles is 1e-15
  // The whole: initial + work, never more than 1 % of the reference above (an explicit step's
  // elastic energy oscillates), and the ledger's terms add up to the energy there is.
  const double now_j = engine->MechanicalEnergy();
  const double booked = ledger.initial_j + ledger.external_work_j + ledger.tool_work_j -
                        ledger.captured_j - ledger.viscous_j + ledger.rotation_j + ledger.volume_j +
                        ledger.sliding_j - ledger.numerical_j + ledger.correction_j;
  const double last_step =
      now_j - ledger.kinetic_j - ledger.elastic_j + ledger.elastic_work_j;  // not yet booked
  EXPECT_NEAR(now_j, booked + last_step, 1e-9 * EnergyReference(ledger));
  EXPECT_LE(now_j, ledger.initial_j + ledger.external_work_j + 0.01 * EnergyReference(ledger));
  EXPECT_LT(std::abs(ledger.rotation_j), 1e-12 * EnergyReference(ledger));
}

TEST(Momentum, IsConservedWhileSpinningBodiesStickAndPart) {
  auto engine = EngineOf(kChurningCells);
  StepMany(engine.get(), TestSize(3000, 10000));
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
}

TEST(Momentum, IsConservedWhileSpinningBodiesRub) {
  auto engine = EngineOf(RubbingCells());
  StepMany(engine.get(), TestSize(3000, 10000));
  EXPECT_LT(engine->state().ledger.sliding_j, 0);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
}

TEST(Momentum, OfAFreeSpinningBodyIsConservedWithExactVolume) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.5}, mass_kg: 1, position_m: [3, 0, 0], angular_velocity_rad_s: [0.6, 0, 0.8]}
effects:
  - shape_memory: {stiffness_n_m: 30}
  - volume_preservation: {}
)");
  StepMany(engine.get(), TestSize(2000, 10000));
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-12);
  EXPECT_LE(error.angular, 1e-11);  // a position-only volume correction leaves 6.6e-4 here
}

// The integrator's own loss vanishes with the step: first order or better.
TEST(Ledger, NumericalTermVanishesWithTheStep) {
  const auto numerical = [](int rate_hz) {
    auto engine = EngineOf("rate_hz: " + std::to_string(rate_hz) + R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.5}, mass_kg: 1, position_m: [0, 0, 0.7], velocity_m_s: [0, 0, -1]}
  - {name: floor, sheet: {length_m: 4, width_m: 4, columns: 5, rows: 5}, mass_kg: 1, fixed: [all: true]}
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.01}
)");
    StepMany(engine.get(), static_cast<int>(0.6 * rate_hz));
    return std::abs(engine->state().ledger.numerical_j - engine->state().ledger.volume_j) /
           EnergyReference(engine->state().ledger);
  };
  const double coarse = numerical(500), fine = numerical(2000), finest = numerical(8000);
  EXPECT_LT(finest, 0.5 * fine);
  EXPECT_LT(fine, 0.7 * coarse);
  EXPECT_LT(finest, 2e-3);
}

// A ball that turns by 1.5 rad a step: the volume's gradient of the step's start points elsewhere
// at its end, and the iteration led away, to 600 times the energy.
TEST(Volume, ADivergingIterationAddsNoEnergy) {
  auto engine = EngineOf(R"(
rate_hz: 100
bodies:
  - {name: a, icosphere: {radius_m: 0.03}, mass_kg: 0.01, angular_velocity_rad_s: [0, 0, 150]}
effects:
  - shape_memory: {stiffness_n_m: 0.1}
  - volume_preservation: {}
)");
  bool reported = false;
  for (int step = 0; step < 500; ++step) {
    reported |= (engine->Step({}).bits & kStepVolumeNotMet) != 0;
    // A straight step of 1.5 rad stretches the ball: half as much again, with or without volumes.
    ASSERT_LE(engine->MechanicalEnergy(), 1.5 * engine->state().ledger.initial_j) << step;
  }
  EXPECT_TRUE(reported);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

// Symplectic Euler keeps H + dt/2 f.v of springs exactly. Strains of 1e-4 are as good as linear; at
// half of the stability bound H itself swings by some per cent.
TEST(KeptEnergy, IsWhatExplicitStepsKeepOfStrainedTissue) {
  auto engine = EngineOf(R"(
rate_hz: 200
integration: {integrator: INTEGRATOR_EXPLICIT}
bodies:
  - {name: a, block: {size_m: [0.1, 0.05, 0.05]}, tetrahedra: {cells: 4}, density_kg_m3: 1000}
effects:
  - elasticity: {young_modulus_pa: 5000}
)");
  State strewn = engine->state();
  for (std::size_t p = 0; p < strewn.position_m.size(); ++p) {
    strewn.position_m[p] *= p % 2 == 0 ? 1 + 1e-4 : 1 - 1e-4;
  }
  engine->Restore(strewn);
  const double start_j = engine->MechanicalEnergy();
  EXPECT_EQ(engine->KeptEnergy(), start_j);  // nothing moves yet
  double swing = 0, drift = 0;
  for (int step = 0; step < 400; ++step) {
    engine->Step({});
    swing = std::max(swing, std::abs(engine->MechanicalEnergy() / start_j - 1));
    drift = std::max(drift, std::abs(engine->KeptEnergy() / start_j - 1));
  }
  EXPECT_GT(swing, 0.02);
  EXPECT_LT(drift, 1e-3);
}

// The free edge of a sheet swings at 1.5 m/s while contact looks at half a millimetre: a number of
// sub-steps that follows its speed swings with it, and took 47 % of its energy within a second.
TEST(KeptEnergy, IsKeptWhereSpeedAsksForMoreSubsteps) {
  auto engine = EngineOf(R"(
rate_hz: 500
integration: {max_substeps: 500}
bodies:
  - {name: sheet, sheet: {length_m: 0.06, width_m: 0.06, columns: 4, rows: 4}, mass_kg: 0.001,
     fixed: [half_space: {point_m: [-0.029, 0, 0], normal: [-1, 0, 0]}], velocity_m_s: [0, 0, 1.5]}
tools:
  - {name: far, needle: {length_m: 0.1, radius_m: 0.001}, position_m: [0, 0.5, 0]}
effects:
  - shape_memory: {stiffness_n_m: 400}
  - virtual_adhesive: {capture_distance_m: 0.0005, normal_strength_pa: 5}
)");
  const double start_j = engine->MechanicalEnergy();
  int most = 0;
  double drift = 0;
  for (int step = 0; step < 500; ++step) {
    engine->Step({});
    most = std::max(most, static_cast<int>(engine->state().substeps));
    drift = std::max(drift, std::abs(engine->KeptEnergy() / start_j - 1));
  }
  EXPECT_GT(most, engine->substeps());
  EXPECT_LT(drift, 0.01);
}

}  // namespace
}  // namespace adhesim::test
