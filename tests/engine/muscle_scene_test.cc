#include <gtest/gtest.h>

#include <cmath>

#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

// Mean position of those particles of a body that started within 1 cm of x.
Vec3 MeanOfFace(const Engine& engine, int body, double x_m) {
  const Model& model = engine.model();
  const Body& of = model.bodies[body];
  Vec3 sum = Vec3::Zero();
  int count = 0;
  for (int p = of.first_particle; p < of.first_particle + of.particle_count; ++p) {
    if (std::abs(model.rest_position_m[p].x() - x_m) > 0.01) continue;
    sum += engine.state().position_m[p];
    ++count;
  }
  return sum / count;
}

constexpr int kMuscle = 0, kFreeBone = 2;

TEST(MuscleScene, ContractionPullsTheFreeBoneByWhatTheMuscleShortens) {
  const auto engine = SceneEngine("paper/muscle_between_bones.yaml");
  const auto bone_x_m = [&] { return MeanOfFace(*engine, kFreeBone, 0.605).x(); };
  const auto length_m = [&] {
    return (MeanOfFace(*engine, kMuscle, 0.6) - MeanOfFace(*engine, kMuscle, -0.6)).x();
  };
  EXPECT_EQ(StepMany(engine.get(), 200), 0u);
  ASSERT_EQ(engine->state().contacts.zones.size(), 2u);  // one for each bone
  const double bone_before_m = bone_x_m(), length_before_m = length_m();
  EXPECT_EQ(StepMany(engine.get(), 1800), 0u);
  const double pulled_m = bone_before_m - bone_x_m();
  EXPECT_GE(pulled_m, 0.05 * length_before_m);
  // Bone and muscle keep their distance but for the bone's small turns: 1 % of the way.
  EXPECT_NEAR(length_before_m - length_m(), pulled_m, 0.01 * pulled_m);
  EXPECT_GT(engine->state().ledger.external_work_j, 0);  // the fibres' work
  EXPECT_EQ(StepMany(engine.get(), 2000), 0u);
  // Elastic: once it lets go, the bone is back where it was.
  EXPECT_NEAR(bone_x_m(), bone_before_m, 0.1 * pulled_m);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

// Nothing outside pulls on a muscle and two free bones: they draw each other near, and momentum
// stays what it was.
TEST(MuscleScene, BetweenTwoFreeBonesMomentumStays) {
  SceneFile file = ReadSceneFile(ADHESIM_SOURCE_DIR "/scenes/paper/muscle_between_bones.yaml");
  file.scene.mutable_bodies(1)->clear_fixed();
  ASSERT_TRUE(file.scene.effects(3).has_drag());
  file.scene.mutable_effects()->DeleteSubrange(3, 1);
  const auto engine = EngineOf(ModelOf(file));
  EXPECT_EQ(StepMany(engine.get(), 1500), 0u);
  EXPECT_EQ(engine->state().contacts.zones.size(), 2u);
  const MomentumLedger& momentum = engine->state().momentum;
  // Fibres are equal and opposite: round-off of 1500 steps.
  EXPECT_LE(momentum.impulse_linear.norm(), 1e-12 * momentum.scale_linear);
  EXPECT_LE(momentum.impulse_angular.norm(), 1e-12 * momentum.scale_angular);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-11);
  EXPECT_LE(error.angular, 1e-11);
  EXPECT_GT(engine->state().ledger.external_work_j, 0);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

}  // namespace
}  // namespace adhesim::test
