#include <gtest/gtest.h>

#include <array>

#include "core/effects/registry.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

// The elastic forces of the scene's effects where the particles are now.
std::vector<Vec3> ElasticForces(const Engine& engine) {
  const Model& model = engine.model();
  const std::size_t n = model.rest_position_m.size();
  std::vector<Vec3> elastic(n, Vec3::Zero());
  Parallel one(1);
  for (const v1::Effect& message : model.scene.effects()) {
    if (!message.has_shape_memory()) continue;
    auto effect = MakeEffect(model, message);
    EXPECT_TRUE(effect.ok());
    std::vector<double> state((*effect)->state_size());
    (*effect)->InitialState(state);
    std::array<std::vector<Vec3>, kForceKinds> force;
    for (int k = 0; k < 20; ++k) {  // its rotations converge over the calls
      for (auto& f : force) f.assign(n, Vec3::Zero());
      (*effect)->AddForces({engine.state().position_m, engine.state().velocity_m_s, 0, state, &one},
                           {force[0], force[1], force[2], force[3]});
    }
    for (std::size_t i = 0; i < n; ++i) elastic[i] += force[0][i];
  }
  return elastic;
}

TEST(RigidOnElastic, TheSheetCarriesTheWeightThatHangsFromIt) {
  const auto engine = SceneEngine("paper/rigid_on_elastic.yaml");
  EXPECT_EQ(StepMany(engine.get(), 6000), 0u);
  const Model& model = engine->model();
  ASSERT_EQ(engine->state().contacts.zones.size(), 1u);
  const Zone& zone = engine->state().contacts.zones[0];
  EXPECT_EQ(zone.bodies, 2);
  EXPECT_EQ(zone.rigid_body, 1);
  // What the sheet pulls on the zone is what hangs there: the ball and the sheet's own particles.
  const std::vector<Vec3> elastic = ElasticForces(*engine);
  Vec3 pull_n = Vec3::Zero();
  double mass_kg = 0, ball_kg = 0;
  for (int k = zone.first; k < zone.first + zone.count; ++k) {
    const int p = engine->state().contacts.zone_members[k];
    pull_n += elastic[p];
    mass_kg += model.mass_kg[p];
    if (model.body_of[p] == 1) ball_kg += model.mass_kg[p];
  }
  EXPECT_NEAR(ball_kg, 1, 1e-12);
  // 6 s at a drag of 2 / s leave some thousandths of the swing.
  EXPECT_NEAR(pull_n.z(), 9.81 * mass_kg, 0.01 * 9.81 * mass_kg);
  EXPECT_LE(pull_n.head<2>().norm(), 0.01 * pull_n.z());
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

TEST(ZoneOfThree, HoldsThreeBodiesAndKeepsTheirMomenta) {
  const auto engine = SceneEngine("paper/zone_of_three.yaml");
  const Model& model = engine->model();
  const auto total = [&](bool angular) {
    Vec3 sum = Vec3::Zero();
    for (int p = 0; p < model.particle_count(); ++p) {
      const Vec3 momentum = model.mass_kg[p] * engine->state().velocity_m_s[p];
      sum += angular ? Vec3(engine->state().position_m[p].cross(momentum)) : momentum;
    }
    return sum;
  };
  const Vec3 linear = total(false), angular = total(true);
  EXPECT_EQ(StepMany(engine.get(), 2000), 0u);
  ASSERT_EQ(engine->state().contacts.zones.size(), 1u);
  EXPECT_EQ(engine->state().contacts.zones[0].bodies, 3);
  // Round-off of 2000 steps of 126 particles, some kg m/s in all. The angular momentum drifts by
  // 1e-14 a step (measured), as the volume is met to a tolerance.
  EXPECT_LE((total(false) - linear).norm(), 1e-11);
  EXPECT_LE((total(true) - angular).norm(), 1e-10);
  EXPECT_GT(angular.norm(), 0.5);  // they turn
  EXPECT_GT(engine->state().ledger.captured_j, 0);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

}  // namespace
}  // namespace adhesim::test
