#include <gtest/gtest.h>

#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

TEST(Needle, PushesSticksPullsAndLetsGo) {
  auto engine = EngineOf(NeedleScene(kPressAndPull));
  double before = 0, push = 0, pull = 0;
  int most = 0;
  for (int step = 0; step < 1400; ++step) {
    ASSERT_EQ(engine->Step({}).bits & ~static_cast<std::uint32_t>(kStepReleasePasses), 0u) << step;
    const double force = engine->state().tools[0].tissue.force_n.z();
    if (engine->state().time_s < 0.05) before = std::max(before, std::abs(force));
    push = std::max(push, force);
    pull = std::min(pull, force);
    most = std::max(most, engine->state().contacts.colliding_particles);
  }
  EXPECT_EQ(before, 0);
  EXPECT_GT(push, 0.05);
  EXPECT_LT(pull, -0.02);
  EXPECT_GE(most, 3);
  EXPECT_TRUE(engine->state().contacts.bonds.empty());
  EXPECT_EQ(engine->state().tools[0].tissue.force_n.norm(), 0);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  const MomentumError momentum = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(momentum.linear, 1e-10);
  EXPECT_LE(momentum.angular, 1e-10);
  EXPECT_NE(engine->state().ledger.tool_work_j, 0);
}

TEST(Needle, ForceIsTheRateOfChangeOfTheTissuesMomentum) {
  // Nothing else from outside but the tool: its impulse is the whole change of momentum.
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.05, subdivisions: 2}, mass_kg: 0.5}
tools:
  - name: needle
    needle: {}
    position_m: [0, 0.004, 0.054]
    adhesion: {normal_strength_pa: 1e5}
    trajectory:
      - {t_s: 0.0, position_m: [0, 0.004, 0.054]}
      - {t_s: 0.3, position_m: [0, 0.010, 0.030], orientation_wxyz: [0.98, 0.2, 0, 0]}
effects:
  - shape_memory: {stiffness_n_m: 40}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
  const Model& model = engine->model();
  const auto linear = [&] {
    Vec3 sum = Vec3::Zero();
    for (int p = 0; p < model.particle_count(); ++p)
      sum += model.mass_kg[p] * engine->state().velocity_m_s[p];
    return sum;
  };
  double largest = 0;
  Vec3 worst = Vec3::Zero();
  for (int step = 0; step < 400; ++step) {
    const Vec3 before = linear();
    engine->Step({});
    const Vec3 rate = (linear() - before) / model.dt_s;
    worst = worst.cwiseMax((rate + engine->state().tools[0].tissue.force_n).cwiseAbs());
    largest = std::max(largest, rate.norm());
  }
  EXPECT_GT(largest, 0.1);
  // Captures within the step give tissue the tool's velocity at once: that impulse is part of the
  // force too.
  EXPECT_LT(worst.norm(), 1e-9 * largest);
}

TEST(Needle, LagsBehindATargetBeyondItsForceLimit) {
  auto engine = EngineOf(NeedleScene(R"(
    coupling: {stiffness_n_m: 500, max_force_n: 0.05}
    trajectory:
      - {t_s: 0.0, position_m: [0.003, 0.002, 0.055]}
      - {t_s: 0.4, position_m: [0.003, 0.002, 0.020]}
)"));
  StepMany(engine.get(), 1500);
  const ToolState& tool = engine->state().tools[0];
  EXPECT_TRUE(tool.flags & kToolForceLimited);
  EXPECT_GT(tool.pose.position_m.z() - tool.target.position_m.z(), 0.005);
  EXPECT_NEAR(tool.coupling.force_n.norm(), 0.05, 1e-9);
  EXPECT_NEAR(tool.tissue.force_n.z(), 0.05,
              0.01);  // at rest the tissue carries what the coupling gives
}

TEST(Needle, AJumpOfTheTargetIsReportedOnceAndFollowedAtTheSpeedLimit) {
  auto engine = EngineOf(R"(
bodies:
  - {name: far_away, icosphere: {radius_m: 0.1}, mass_kg: 1, position_m: [0, 0, 9]}
tools:
  - {name: needle, needle: {}, position_m: [0, 0, 0], coupling: {max_speed_m_s: 0.5}}
)");
  ToolInput input;
  input.has_target = true;
  input.target.position_m = Vec3(1, 0, 0);
  int reported = 0;
  double fastest = 0;
  for (int step = 0; step < 3000; ++step) {
    engine->Step({&input, 1});
    reported += (engine->state().tools[0].flags & kToolTargetJumped) != 0;
    fastest = std::max(fastest, engine->state().tools[0].twist.linear_m_s.norm());
  }
  EXPECT_EQ(reported, 1);
  EXPECT_LE(fastest, 0.5 * (1 + 1e-12));
  EXPECT_GT(fastest, 0.45);
  EXPECT_NEAR(engine->state().tools[0].pose.position_m.x(), 1, 1e-3);
}

TEST(Needle, AtTenMetresPerSecondDoesNotPassThroughAMembrane) {
  auto engine = EngineOf(R"(
integration: {max_substeps: 500}
bodies:
  - name: membrane
    sheet: {length_m: 0.1, width_m: 0.1, columns: 21, rows: 21}
    mass_kg: 0.01
    fixed: [border: true]
tools:
  - name: needle
    needle: {}
    position_m: [0.0013, 0.0007, 0.05]
    coupling: {max_speed_m_s: 10, max_force_n: 1000, stiffness_n_m: 100000}
    trajectory:
      - {t_s: 0.0, position_m: [0.0013, 0.0007, 0.05]}
      - {t_s: 0.010, position_m: [0.0013, 0.0007, -0.03]}
effects:
  - shape_memory: {stiffness_n_m: 500}
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
  double fastest = 0;
  for (int step = 0; step < 15; ++step) {
    EXPECT_EQ(engine->Step({}).bits & static_cast<std::uint32_t>(kStepSubstepLimit), 0u);
    fastest = std::max(fastest, engine->state().tools[0].twist.linear_m_s.norm());
  }
  EXPECT_GT(fastest, 5);
  const ToolState& tool = engine->state().tools[0];
  EXPECT_LT(tool.pose.position_m.z(), 0.0);
  EXPECT_GT(engine->state().contacts.colliding_particles, 0);
  // Caught on the near side: the membrane under the tip is below it.
  double nearest = 1e9, height = 0;
  for (int p = 0; p < engine->model().particle_count(); ++p) {
    const Vec3 away = engine->state().position_m[p] - tool.pose.position_m;
    const double sideways = std::hypot(away.x(), away.y());
    if (sideways < nearest) {
      nearest = sideways;
      height = away.z();
    }
  }
  EXPECT_LT(height, 0.0005);
}

TEST(Lancet, IsStoppedByARigidPlate) {
  auto engine = EngineOf(R"(
bodies:
  - name: plate
    kind: rigid
    block: {size_m: [0.2, 0.2, 0.001], cells: 4}
    mass_kg: 1
    fixed: [all: true]
tools:
  - name: lancet
    lancet: {}
    position_m: [0, 0, 0.02]
    coupling: {max_speed_m_s: 10, max_force_n: 50}
    trajectory:
      - {t_s: 0.0, position_m: [0, 0, 0.02]}
      - {t_s: 0.01, position_m: [0, 0, -0.05]}
)");
  bool obstructed = false;
  for (int step = 0; step < 300; ++step) {
    engine->Step({});
    obstructed = obstructed || (engine->state().tools[0].flags & kToolObstructed);
    EXPECT_GT(engine->state().tools[0].pose.position_m.z(),
              0.0005 - 1e-6);  // the plate's upper face
  }
  EXPECT_TRUE(obstructed);
  EXPECT_LT(engine->state().tools[0].pose.position_m.z(), 0.002);
}

TEST(Tools, ARetractedToolLetsGoOfEverything) {
  auto engine = EngineOf(NeedleScene(kPressAndPull));
  StepMany(engine.get(), 400);
  ASSERT_FALSE(engine->state().contacts.bonds.empty());
  ToolInput input;
  input.retracted = true;
  engine->Step({&input, 1});
  EXPECT_TRUE(engine->state().contacts.bonds.empty());
  EXPECT_TRUE(engine->state().tools[0].flags & kToolRetracted);
  engine->Step({&input, 1});
  EXPECT_EQ(engine->state().tools[0].tissue.force_n.norm(), 0);
}

TEST(Tools, StrengthThatRampsToNothingFreesThePulledTissue) {
  auto engine = EngineOf(NeedleScene(R"(
    adhesion: {normal_strength_pa: 1e9}
    trajectory:
      - {t_s: 0.0, position_m: [0.003, 0.002, 0.055]}
      - {t_s: 0.2, position_m: [0.003, 0.002, 0.045]}
      - {t_s: 0.4, position_m: [0.003, 0.002, 0.060]}
)"));
  StepMany(engine.get(), 800);
  ASSERT_LT(engine->state().tools[0].tissue.force_n.z(), -0.01);
  ToolInput input;
  for (int step = 0; step < 500; ++step) {
    input.strength_scale = 1 - (step + 1) / 500.0;
    engine->Step({&input, 1});
  }
  StepMany(engine.get(), 0);
  EXPECT_TRUE(engine->state().contacts.bonds.empty());
}

TEST(Tools, InContactStillAllocateNothingAndKeepTheirBits) {
  const auto model = ModelOf(NeedleScene(kPressAndPull));
  auto one = EngineOf(model), two = EngineOf(model, 2);
  StepMany(one.get(), 600);
  StepMany(two.get(), 600);
  EXPECT_EQ(one->StateHash(), two->StateHash());
}

}  // namespace
}  // namespace adhesim::test
