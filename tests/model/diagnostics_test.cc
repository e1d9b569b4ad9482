#include "core/model/diagnostics.h"

#include <gtest/gtest.h>

namespace adhesim {
namespace {

// A tetrahedron with right angles at the origin, edges of 1 m: volume 1/6 m^3.
Model Tetrahedron() {
  Model model;
  Body body;
  body.name = "a";
  body.closed = true;
  body.particle_count = 4;
  body.triangle_count = 4;
  body.rest_volume_m3 = 1.0 / 6;
  model.bodies.push_back(body);
  model.rest_position_m = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  model.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  model.mass_kg.assign(4, 2.0);
  return model;
}

State StateOf(const Model& model) {
  State state;
  state.position_m = model.rest_position_m;
  state.velocity_m_s.assign(model.rest_position_m.size(), Vec3::Zero());
  return state;
}

TEST(Diagnostics, IdentityErrorIsRelativeToTheEnergyThatPassed) {
  Ledger ledger;
  EXPECT_EQ(IdentityError(ledger), 0);  // nothing ever moved
  ledger.reference_j = 2;
  ledger.abs_external_j = 3;
  ledger.abs_tool_j = 5;
  ledger.worst_j = 1;
  EXPECT_EQ(EnergyReference(ledger), 10);
  EXPECT_EQ(IdentityError(ledger), 0.1);
}

TEST(Diagnostics, MomentumBalanceCountsWhatNoImpulseExplains) {
  const Model model = Tetrahedron();
  State state = StateOf(model);
  EXPECT_EQ(MomentumBalance(model, state).linear, 0);
  // Particle 1 at (1, 0, 0) moves along y: P = (0, 4, 0), L = (0, 0, 4).
  state.velocity_m_s[1] = Vec3(0, 2, 0);
  state.momentum.scale_linear = 4;
  state.momentum.scale_angular = 4;
  EXPECT_EQ(MomentumBalance(model, state).linear, 1);
  EXPECT_EQ(MomentumBalance(model, state).angular, 1);
  state.momentum.impulse_linear = Vec3(0, 3, 0);
  state.momentum.initial_linear = Vec3(0, 1, 0);
  state.momentum.impulse_angular = Vec3(0, 0, 2);
  EXPECT_EQ(MomentumBalance(model, state).linear, 0);
  EXPECT_EQ(MomentumBalance(model, state).angular, 0.5);
}

TEST(Diagnostics, VolumeErrorLooksAtPreservedBodiesOnly) {
  Model model = Tetrahedron();
  State state = StateOf(model);
  state.position_m[3].z() = 1.5;
  EXPECT_FALSE(VolumeError(model, state).has_value());
  model.scene.add_effects()->mutable_volume_preservation()->add_bodies("other");
  EXPECT_FALSE(VolumeError(model, state).has_value());
  model.scene.mutable_effects(0)->mutable_volume_preservation()->clear_bodies();
  EXPECT_NEAR(*VolumeError(model, state), 0.5, 1e-15);  // a few roundings of numbers near 1
}

}  // namespace
}  // namespace adhesim
