#include "core/effects/muscle/muscle.h"

#include <gtest/gtest.h>

#include <array>
#include <random>

#include "tests/support/engine_fixture.h"
#include "tests/support/tet_block.h"

namespace adhesim::test {
namespace {

// A bar of 4 x 1 x 1 cells, its long edges along x.
std::shared_ptr<const Model> Bar(const std::string& muscle) {
  return ModelOf(
      "bodies:\n  - {name: bar, block: {size_m: [4, 1, 1], cells: 4}, mass_kg: 1}\n"
      "effects:\n  - muscle: " +
      muscle + "\n");
}

std::vector<Vec3> Forces(const Model& model, const std::vector<Vec3>& x, double time_s) {
  const MuscleEffect effect(model, model.scene.effects(0).muscle());
  std::array<std::vector<Vec3>, kForceKinds> force;
  for (auto& f : force) f.assign(x.size(), Vec3::Zero());
  const std::vector<Vec3> v(x.size(), Vec3::Zero());
  Parallel one(1);
  effect.AddForces({x, v, time_s, {}, &one}, {force[0], force[1], force[2], force[3]});
  return force[2];
}

TEST(Muscle, FibresAreTheEdgesAlongItsDirection) {
  const auto model = Bar("{direction: [3, 0, 0], max_force_n: 1}");
  // Four long edges of the box, four cells each; the diagonals of the cells are at 45 degrees.
  EXPECT_EQ(MuscleEffect(*model, model->scene.effects(0).muscle()).fibre_count(), 16);
  const auto with_diagonals = Bar("{direction: [3, 0, 0], max_force_n: 1, least_cosine: 0.7}");
  EXPECT_GT(MuscleEffect(*with_diagonals, with_diagonals->scene.effects(0).muscle()).fibre_count(),
            16);
}

TEST(Muscle, FibresOfABodyOfTetrahedraAreTheirEdgesInsideItToo) {
  const auto model = ModelOf(TetBlock{.cells = {2, 2, 2}});
  v1::Muscle message;
  for (const double d : {0.0, 0.0, 1.0}) message.add_direction(d);
  message.set_max_force_n(1);
  message.set_least_cosine(0.99);
  // Nine upright lines of particles, two edges each: the one through the middle is one of them.
  EXPECT_EQ(MuscleEffect(*model, message).fibre_count(), 18);
}

TEST(Muscle, PullsItsEndsTogetherWithItsForceAndLessWhenStretched) {
  const auto model = Bar("{direction: [1, 0, 0], max_force_n: 5}");
  const auto pull = [&](double stretch) {
    std::vector<Vec3> x = model->rest_position_m;
    for (Vec3& p : x) p.x() *= stretch;
    double sum = 0;  // on the end at -x
    const std::vector<Vec3> force = Forces(*model, x, 0);
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (model->rest_position_m[i].x() < -1.9) sum += force[i].x();
    }
    return sum;
  };
  // Four fibres end there. Force-length: 1 - 4 (stretch - 1)^2. 20 numbers of 1e-16 each.
  EXPECT_NEAR(pull(1), 20, 1e-13);
  EXPECT_NEAR(pull(1.25), 15, 1e-13);
  EXPECT_NEAR(pull(0.75), 15, 1e-13);
  EXPECT_EQ(pull(1.6), 0);
  EXPECT_EQ(pull(0.4), 0);
}

TEST(Muscle, ForcesAndTorquesSumToNothing) {
  const auto model = Bar("{direction: [1, 0, 0], max_force_n: 5, least_cosine: 0}");
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  std::vector<Vec3> x = model->rest_position_m;
  for (Vec3& p : x) p += Vec3(uniform(random), uniform(random), uniform(random));
  Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();
  double size = 0;
  const std::vector<Vec3> force = Forces(*model, x, 0);
  for (std::size_t i = 0; i < x.size(); ++i) {
    sum += force[i];
    moment += x[i].cross(force[i]);
    size += force[i].norm();
  }
  EXPECT_GT(size, 10);
  EXPECT_LT(sum.norm(), 1e-14 * size);  // round-off
  EXPECT_LT(moment.norm(), 1e-14 * size);
}

TEST(Muscle, ActivationIsLinearBetweenItsMomentsAndConstantOutside) {
  const auto model =
      Bar("{direction: [1, 0, 0], max_force_n: 1, schedule: [{t_s: 1, activation: 0.2}, "
          "{t_s: 2, activation: 1}, {t_s: 4, activation: 0}]}");
  const MuscleEffect effect(*model, model->scene.effects(0).muscle());
  EXPECT_EQ(effect.ActivationAt(0), 0.2);
  EXPECT_EQ(effect.ActivationAt(1), 0.2);
  EXPECT_DOUBLE_EQ(effect.ActivationAt(1.5), 0.6);
  EXPECT_EQ(effect.ActivationAt(2), 1);
  EXPECT_DOUBLE_EQ(effect.ActivationAt(3), 0.5);
  EXPECT_EQ(effect.ActivationAt(9), 0);
}

TEST(Muscle, RefusesWhatCannotContract) {
  const auto problems = [](const std::string& body, const std::string& muscle) {
    const SceneFile file =
        ParseScene("bodies:\n  - {name: a, icosphere: {radius_m: 1}, mass_kg: 1" + body +
                       "}\neffects:\n  - muscle: " + muscle + "\n",
                   "test.yaml", "");
    return file.Format(file.problems);
  };
  EXPECT_EQ(problems("", "{direction: [0, 0, 1], max_force_n: 1}"), "");
  EXPECT_NE(problems("", "{direction: [0, 0, 0], max_force_n: 1}").find("has no direction"),
            std::string::npos);
  EXPECT_NE(problems(", kind: rigid", "{bodies: [a], direction: [0, 0, 1], max_force_n: 1}")
                .find("is rigid"),
            std::string::npos);
  EXPECT_NE(problems("",
                     "{direction: [0, 0, 1], max_force_n: 1, schedule: [{t_s: 1, activation: 0}, "
                     "{t_s: 1, activation: 1}]}")
                .find("schedule[1].t_s"),
            std::string::npos);
}

}  // namespace
}  // namespace adhesim::test
