#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

// A strip folded into a U that lies on its lower arm: 0.4 m between the arms, 0.125 m between
// particles.
std::string WriteFoldedStrip() {
  const std::string path = testing::TempDir() + "folded_strip.obj";
  std::ofstream obj(path);
  const int columns = 41, rows = 5;
  const double spacing_m = 0.125, radius_m = 0.2, arc_m = M_PI * radius_m;
  for (int c = 0; c < columns; ++c) {
    const double along = spacing_m * (c - columns / 2);
    const double angle = std::clamp(along / radius_m, -M_PI_2, M_PI_2);
    const double arm = std::max(0.0, std::abs(along) - 0.5 * arc_m);
    for (int r = 0; r < rows; ++r) {
      obj << "v " << radius_m * std::cos(angle) - arm << ' ' << spacing_m * r + 0.04 * arm << ' '
          << radius_m * std::sin(angle) << '\n';
    }
  }
  for (int c = 0; c + 1 < columns; ++c) {
    for (int r = 0; r + 1 < rows; ++r) {
      const int v = c * rows + r + 1;
      obj << "f " << v << ' ' << v + rows << ' ' << v + rows + 1 << '\n';
      obj << "f " << v << ' ' << v + rows + 1 << ' ' << v + 1 << '\n';
    }
  }
  return path;
}

std::string FoldedStrip(const char* self) {
  return "bodies:\n  - {name: strip, mesh: {file: \"" + WriteFoldedStrip() +
         "\"}, mass_kg: 1, fixed: [half_space: {point_m: [0, 0, -0.19], normal: [0, 0, 1]}]}\n" +
         R"(
effects:
  - uniform_gravity: {}
  - shape_memory: {stiffness_n_m: 40, damping_n_s_m: 0.1}
  - virtual_adhesive: {capture_distance_m: 0.01, normal_strength_pa: 1000, self_collision: )" +
         self + "}\n";
}

TEST(SelfCollision, AFoldedSheetSticksToItselfAndPassesNowhereThroughItself) {
  auto engine = EngineOf(FoldedStrip("true"));
  const Model& model = engine->model();
  int most = 0;
  for (int k = 0; k < 40; ++k) {
    EXPECT_EQ(StepMany(engine.get(), 50), 0u);
    ASSERT_EQ(CountEdgesThrough(model, engine->state().position_m, /*self=*/true), 0) << k;
    most = std::max(most, engine->state().contacts.colliding_particles);
  }
  EXPECT_GT(most, 8);
  EXPECT_FALSE(engine->state().contacts.bonds.empty());
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  const MomentumError error = MomentumBalance(model, engine->state());
  EXPECT_LE(error.linear, 1e-9);
  EXPECT_LE(error.angular, 1e-9);
}

TEST(SelfCollision, IsOffUnlessAskedFor) {
  auto engine = EngineOf(FoldedStrip("false"));
  int most = 0;
  for (int k = 0; k < 40; ++k) {
    StepMany(engine.get(), 25);
    most = std::max(most, CountEdgesThrough(engine->model(), engine->state().position_m, true));
  }
  EXPECT_TRUE(engine->state().contacts.bonds.empty());
  EXPECT_GT(most, 0);  // what the test above prevents
}

// Both faces of a block thinner than the capture distance, or a little thicker than the release
// distance and moving.
TEST(SelfCollision, AThinBlockDoesNotGlueItselfTogether) {
  for (const char* thickness : {"0.008", "0.02"}) {
    auto engine =
        EngineOf(std::string("bodies:\n  - {name: plate, block: {size_m: [1, 1, ") + thickness +
                 R"(], cells: 6}, mass_kg: 1, angular_velocity_rad_s: [1, 2, 3]}
effects:
  - shape_memory: {stiffness_n_m: 100}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.01, self_collision: true}
)");
    int captures = 0;
    for (int k = 0; k < 300; ++k) captures += engine->Step({}).captures;
    EXPECT_EQ(captures, 0) << thickness;
  }
}

}  // namespace
}  // namespace adhesim::test
