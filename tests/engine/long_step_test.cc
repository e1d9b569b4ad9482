// Steps so long that what comes within them cannot be told at their start: they are divided when a
// trial shows it, and only then.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/engine/engine.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim {
namespace {

using test::EngineOf;

// A soft cube of 20 mm above a floor.
std::string FallingCube(int rate_hz, const std::string& height_m, const std::string& adhesive) {
  return "rate_hz: " + std::to_string(rate_hz) + R"(
integration: {tolerance: 1e-12}
bodies:
  - {name: floor, sheet: {length_m: 0.1, width_m: 0.1, columns: 5, rows: 5}, mass_kg: 1, fixed: [all: true]}
  - {name: cube, block: {size_m: [0.02, 0.02, 0.02]}, tetrahedra: {cells: 2}, position_m: [0, 0, )" +
         height_m + R"(], density_kg_m3: 1000}
effects:
  - elasticity: {young_modulus_pa: 1000, stiffness_damping_s: 0.002}
  - uniform_gravity: {}
  - virtual_adhesive: {)" +
         adhesive + "}\n";
}

// From rest it would fall 24.5 mm in one step of 50 ms, more than the capture distance of 22 mm,
// and is as fast then as asks for three sub-steps of half of it each. These are the three steps of
// 60 Hz: of the trial that was given up nothing is left, though the cube is stretched and its
// forces over 50 ms are others.
TEST(LongStep, DividedItIsTheShortStepsThatItIsDividedInto) {
  auto once = EngineOf(FallingCube(20, "0.042", "capture_distance_m: 0.022"));
  auto thrice = EngineOf(FallingCube(60, "0.042", "capture_distance_m: 0.022"));
  State start = once->state();
  const Body& cube = once->model().bodies[1];
  for (int k = 0; k < cube.particle_count; ++k) {
    Vec3& x = start.position_m[cube.first_particle + k];
    x.x() *= 1.1;
  }
  once->Restore(start);
  thrice->Restore(start);
  EXPECT_EQ(once->Step({}).bits, 0u);
  for (int k = 0; k < 3; ++k) EXPECT_EQ(thrice->Step({}).bits, 0u);
  for (int p = 0; p < once->model().particle_count(); ++p) {
    EXPECT_LT((once->state().position_m[p] - thrice->state().position_m[p]).norm(), 1e-9) << p;
  }
}

// What falls from rest over 10 mm in steps of 50 ms, in which it would fall 24.5 mm, lands: nothing
// of it is ever deeper than the capture distance, and steps in which it rests are one sub-step each
// (chance decides once in each).
TEST(LongStep, WhatFallsFromRestLandsAndRestsInOneSubStepEach) {
  auto engine = EngineOf(FallingCube(
      20, "0.02",
      "capture_distance_m: 0.001, normal_strength_pa: 1000, bell: {rate_per_s: 0, force_n: 1}"));
  const Body& cube = engine->model().bodies[1];
  const auto lowest_m = [&] {
    double z = INFINITY;
    for (int k = 0; k < cube.particle_count; ++k) {
      z = std::min(z, engine->state().position_m[cube.first_particle + k].z());
    }
    return z;
  };
  for (int k = 0; k < 20; ++k) {
    EXPECT_EQ(engine->Step({}).bits, 0u);
    EXPECT_GT(lowest_m(), 0) << k;
  }
  EXPECT_LT(lowest_m(), 0.001);
  EXPECT_LT(IdentityError(engine->state().ledger), 1e-9);
  const std::uint64_t before = engine->state().contacts.draws;
  for (int k = 0; k < 10; ++k) engine->Step({});
  EXPECT_EQ(engine->state().contacts.draws - before, 10u);
}

}  // namespace
}  // namespace adhesim
