#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/model/diagnostics.h"
#include "tests/support/dragged_bar.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

// Tissue that slides on tools.
namespace adhesim::test {
namespace {

// A block of tissue, its bottom held, and a long bar across it.
std::string BarOnBlock(double mu, double shear_pa) {
  return R"(
rate_hz: 1000
integration: {integrator: explicit}
bodies:
  - {name: tissue, block: {size_m: [0.06, 0.06, 0.03]}, tetrahedra: {cells: 6}, density_kg_m3: 1000, fixed: [half_space: {point_m: [0, 0, -0.0149], normal: [0, 0, 1]}]}
)" + ToolsOf({-0.15, 0.0453, 0.0432, mu, 0, shear_pa}) +
         R"(effects:
  - elasticity: {young_modulus_pa: 3000, poisson_ratio: 0.3, stiffness_damping_s: 0.002}
  - drag: {rate_per_s: 20}
  - virtual_adhesive: {capture_distance_m: 0.0005, normal_strength_pa: 0}
)";
}

// Of the particles that slide on the tool, each once.
double TouchedArea(const Engine& engine) {
  std::set<int> touched;
  for (const Bond& bond : engine.state().contacts.bonds) {
    if (bond.tool < 0 || !bond.sliding) continue;
    for (int k = 0; k < 3; ++k) {
      if (bond.weights[k] > 0) touched.insert(engine.model().triangles[bond.triangle][k]);
    }
  }
  double area_m2 = 0;
  for (int p : touched) area_m2 += engine.model().area_m2[p];
  return area_m2;
}

TEST(ToolSliding, ADraggedToolFeelsShearStrengthTimesAreaAndFriction) {
  const double mu = 0.3, shear_pa = 40;
  auto engine = EngineOf(BarOnBlock(mu, shear_pa));
  double along_n = 0, across_n = 0, area_m2 = 0, jump_m = 0, last_z = 0;
  double sliding = 0, gained = 0;
  int count = 0;
  for (int step = 0; step < (kSanitized ? 700 : 900); ++step) {
    EXPECT_EQ(engine->Step({}).bits & ~static_cast<std::uint32_t>(kStepSubstepLimit), 0u);
    const ToolState& tool = engine->state().tools[0];
    gained += std::max(0.0, engine->state().ledger.sliding_j - sliding);
    sliding = engine->state().ledger.sliding_j;
    if (step > 400) jump_m = std::max(jump_m, std::abs(tool.pose.position_m.z() - last_z));
    last_z = tool.pose.position_m.z();
    if (step < 600) continue;
    along_n -= tool.tissue.force_n.x();
    across_n += tool.tissue.force_n.z();
    area_m2 += TouchedArea(*engine);
    ++count;
  }
  along_n /= count;
  across_n /= count;
  area_m2 /= count;
  const double expected_n = shear_pa * area_m2 + mu * across_n;
  EXPECT_GT(across_n, 0.05);
  EXPECT_GT(area_m2, 1e-4);
  // The issue's 5 per cent: the bar is round, so that pressure is not all across.
  EXPECT_NEAR(along_n, expected_n, 0.05 * expected_n);
  EXPECT_LT(jump_m, 5e-5);  // a tenth of the capture distance a step
  const Ledger& ledger = engine->state().ledger;
  EXPECT_LT(ledger.sliding_j, 0);
  EXPECT_LT(gained, -1e-3 * ledger.sliding_j);
  EXPECT_LE(IdentityError(ledger), 1e-9);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-9);
  EXPECT_LE(error.angular, 1e-9);
}

// Slower than friction allows it sticks, and goes along.
TEST(ToolSliding, WhatFrictionHoldsSticksToTheTool) {
  auto engine = EngineOf(BarOnBlock(10, 1000));
  StepMany(engine.get(), 350);
  const std::vector<Bond>& bonds = engine->state().contacts.bonds;
  EXPECT_TRUE(std::any_of(bonds.begin(), bonds.end(),
                          [](const Bond& bond) { return bond.tool >= 0 && !bond.sliding; }));
}

}  // namespace
}  // namespace adhesim::test
