// Surfaces do not pass through each other, however soft, folded or often let go they are. The
// scenes are cut down from random ones in which they did.

#include <gtest/gtest.h>

#include <string>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

// Steps, and every 10 steps demands that no particle is inside another body and no edge through
// one, by exact and slow means that share nothing with detection.
void ExpectNothingPasses(const std::string& scene, int steps) {
  auto engine = EngineOf(scene);
  for (int step = 0; step < steps; ++step) {
    ASSERT_EQ(engine->Step({}).bits, 0u) << "step " << step;
    if (step % 10 != 9) continue;
    const std::vector<Vec3>& x = engine->state().position_m;
    ASSERT_EQ(MeasurePenetration(engine->model(), x).vertices_inside, 0) << "step " << step;
    ASSERT_EQ(CountEdgesThrough(engine->model(), x), 0) << "step " << step;
  }
  EXPECT_GT(engine->state().ledger.captured_j, 0);  // they have met
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
}

// So soft that the far side of the falling ball falls through its near one and meets the other ball
// with its back.
TEST(Passing, ABallThatFoldsOverIsKeptOff) {
  ExpectNothingPasses(R"(
rate_hz: 500
bodies:
  - {name: falling, icosphere: {radius_m: 0.0225, subdivisions: 1}, mass_kg: 1, position_m: [-0.0278, 0.0462, 0.1098], rotation_deg: [95.1624, 60.2961, -160.3883], velocity_m_s: [0.4551, -0.2168, -0.1101], angular_velocity_rad_s: [4.9103, -3.5975, -3.0207]}
  - {name: standing, icosphere: {radius_m: 0.0313, subdivisions: 1}, fixed: [half_space: {point_m: [0, 0, 0.0198348], normal: [0, 0, 1]}], mass_kg: 1, position_m: [0.0493, 0.0244, 0.0198], rotation_deg: [-99.7728, -62.8287, -14.0278]}
effects:
  - shape_memory: {stiffness_n_m: 100, damping_n_s_m: 0.02}
  - volume_preservation: {}
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 0}
)",
                      300);
}

// What has let go is not caught again before it is pressed closer than it was. Over many turns that
// takes it down to nothing, and within one sub-step through.
TEST(Passing, WhatLetsGoAgainAndAgainComesNoNearer) {
  ExpectNothingPasses(R"(
bodies:
  - {name: light, icosphere: {radius_m: 0.0274, subdivisions: 0}, mass_kg: 0.01, position_m: [0.0466, 0.0351, -0.0257], rotation_deg: [-138.6503, 73.2864, -90.4833], velocity_m_s: [0.0329, -0.0896, 0.0611], angular_velocity_rad_s: [-0.5297, 0.1961, -0.2487]}
  - {name: heavy, block: {size_m: [0.0217, 0.0246, 0.0185], cells: 3}, mass_kg: 1, position_m: [-0.0408, -0.0297, -0.0406], rotation_deg: [-29.4882, -16.1984, 77.6829], velocity_m_s: [-0.313, -0.276, 0.1761], angular_velocity_rad_s: [1.3911, -3.1647, -4.5234]}
effects:
  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: 9.54955}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 1000}
)",
                      700);
}

TEST(Passing, ASheetBlownOntoABallStaysOnItsSide) {
  ExpectNothingPasses(R"(
rate_hz: 500
bodies:
  - {name: held, icosphere: {radius_m: 0.0166, subdivisions: 0}, fixed: [half_space: {point_m: [0, 0, -0.0369722], normal: [0, 0, 1]}], mass_kg: 1, position_m: [0.0187, 0.0368, -0.0370], rotation_deg: [-39.4661, -136.3363, -112.1973]}
  - {name: blown, sheet: {length_m: 0.0652, width_m: 0.0418, columns: 4, rows: 4}, mass_kg: 0.1, position_m: [-0.0101, 0.0228, 0.0037], rotation_deg: [104.9367, 32.1176, 78.6754]}
effects:
  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: 5.9907}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 10}
)",
                      300);
}

TEST(Passing, ASheetSlidesOverABlockWithoutFriction) {
  ExpectNothingPasses(R"(
bodies:
  - {name: block, block: {size_m: [0.0313, 0.0160, 0.0256], cells: 2}, kind: rigid, mass_kg: 1, position_m: [-0.0538, 0.0904, -0.0256], rotation_deg: [121.7457, -128.0789, -153.9695], velocity_m_s: [-0.0485, -0.088, -0.0594], angular_velocity_rad_s: [-0.859, -0.4687, 0.5308]}
  - {name: sheet, sheet: {length_m: 0.0418, width_m: 0.0640, columns: 7, rows: 2}, mass_kg: 0.1, position_m: [0.0074, -0.1077, -0.1096], rotation_deg: [113.8543, -26.6515, -95.529], velocity_m_s: [0.0946, -0.0102, -0.0032], angular_velocity_rad_s: [-0.1868, 0.6646, -0.902]}
effects:
  - shape_memory: {stiffness_n_m: 20, damping_n_s_m: 0.02}
  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: 7.04403}
  - virtual_adhesive: {capture_distance_m: 0.0005, normal_strength_pa: 0, friction_coefficient: 0}
)",
                      800);
}

}  // namespace
}  // namespace adhesim::test
