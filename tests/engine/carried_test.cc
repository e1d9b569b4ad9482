// Surfaces that a coarser lattice of tetrahedra carries, in contact: what touches is the surface,
// what moves are the lattice's nodes.

#include "core/model/carried.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

// Two balls of tissue in free space that meet off centre and stick; what pulls them apart later is
// up to the test.
std::string TwoBalls(const std::string& strength, const std::string& integrator = "implicit") {
  return R"(
rate_hz: 500
integration: {integrator: )" +
         integrator + R"(, tolerance: 1e-10}
bodies:
  - {name: left, icosphere: {radius_m: 0.03, subdivisions: 2}, tetrahedra: {cells: 4}, density_kg_m3: 1000, position_m: [-0.0315, 0, 0], velocity_m_s: [0.1, 0, 0]}
  - {name: right, icosphere: {radius_m: 0.03, subdivisions: 2}, tetrahedra: {cells: 5}, density_kg_m3: 1000, position_m: [0.0315, 0.008, 0.003], velocity_m_s: [-0.1, 0.02, 0]}
effects:
  - elasticity: {young_modulus_pa: 5000, stiffness_damping_s: 0.002}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: )" +
         strength + "}\n";
}

// The largest distance of a carried particle from the weighted mean of its carriers, and of its
// velocity, over the largest of either.
double OffItsCarriers(const Engine& engine) {
  double off = 0;
  const Model& model = engine.model();
  for (const std::vector<Vec3>* values :
       {&engine.state().position_m, &engine.state().velocity_m_s}) {
    std::vector<Vec3> carried = *values;
    Carry(model, carried);
    double largest = 0, apart = 0;
    for (int p = 0; p < model.particle_count(); ++p) {
      largest = std::max(largest, carried[p].norm());
      apart = std::max(apart, (carried[p] - (*values)[p]).norm());
    }
    off = std::max(off, apart / largest);
  }
  return off;
}

int Bonds(const Engine& engine) { return static_cast<int>(engine.state().contacts.bonds.size()); }

TEST(Carried, BallsThatMeetStickAndKeepTheirMomentum) {
  auto engine = EngineOf(TwoBalls("100000"));
  ASSERT_FALSE(engine->model().carried.empty());
  double worst = 0;
  for (int step = 0; step < (kSanitized ? 120 : 200); ++step) {
    ASSERT_EQ(engine->Step({}).bits, 0u) << "step " << step;
    worst = std::max(worst, OffItsCarriers(*engine));
  }
  // Nodes of a lattice do not touch anything, those outside their surface neither.
  ASSERT_GT(Bonds(*engine), 3);
  for (const Bond& bond : engine->state().contacts.bonds) {
    bond.ForEachMember([&](int p) { EXPECT_TRUE(engine->model().OnSurface(p)); });
  }
  EXPECT_LT(worst, 1e-14);  // a mean of four: roundings
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  EXPECT_GT(engine->state().ledger.captured_j, 0);
  EXPECT_LE(MomentumBalance(engine->model(), engine->state()).linear, 1e-10);
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
}

// Explicit steps move zones as rigid bodies, so that both momenta are kept.
TEST(Carried, ExplicitStepsKeepBothMomenta) {
  auto engine = EngineOf(TwoBalls("100000", "explicit"));
  ASSERT_EQ(StepMany(engine.get(), 100), 0u);
  ASSERT_GT(Bonds(*engine), 3);
  EXPECT_LT(OffItsCarriers(*engine), 1e-14);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
}

// What does not stick rebounds: no bond is left, and the balls part.
TEST(Carried, BallsWithoutStrengthPart) {
  auto engine = EngineOf(TwoBalls("0"));
  int most = 0;
  for (int step = 0; step < (kSanitized ? 200 : 400); ++step) {
    ASSERT_EQ(engine->Step({}).bits, 0u) << "step " << step;
    most = std::max(most, Bonds(*engine));
    ASSERT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0)
        << "step " << step;
  }
  EXPECT_GT(most, 0);
  EXPECT_EQ(Bonds(*engine), 0);
  EXPECT_LE(MomentumBalance(engine->model(), engine->state()).linear, 1e-10);
}

// A ball hangs on a fixed block by its adhesive: held, the contacts carry its weight; with a
// strength below the weight, it falls.
TEST(Carried, WhatHangsIsCarriedByItsContacts) {
  const auto hanging = [](const std::string& strength) {
    return R"(
rate_hz: 500
integration: {tolerance: 1e-10}
bodies:
  - {name: ceiling, block: {size_m: [0.1, 0.1, 0.02], cells: 6}, mass_kg: 1, position_m: [0, 0, 0.0105], fixed: [all: true]}
  - {name: lump, icosphere: {radius_m: 0.02, subdivisions: 2}, tetrahedra: {cells: 4}, density_kg_m3: 1000, position_m: [0.003, 0.002, -0.01965], velocity_m_s: [0, 0, 0.1]}
effects:
  - elasticity: {young_modulus_pa: 8000, stiffness_damping_s: 0.01}
  - uniform_gravity: {}
  - drag: {rate_per_s: 5}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: )" +
           strength + "}\n";
  };
  auto engine = EngineOf(hanging("1000000"));
  ASSERT_EQ(StepMany(engine.get(), 1500), 0u);
  ASSERT_GT(Bonds(*engine), 0);
  double mass_kg = 0;
  const Body& lump = engine->model().bodies[1];
  for (int k = 0; k < lump.particle_count; ++k)
    mass_kg += engine->model().mass_kg[lump.first_particle + k];
  Frame frame = engine->MakeFrame();
  engine->WriteFrame(&frame);
  Vec3 force = Vec3::Zero();
  for (const ContactFrame& contact : frame.contacts) {
    force += (contact.body == 1 ? 1 : -1) * contact.normal_force_n * contact.normal;  // on the lump
  }
  // Two bonds or more share the weight; what is tangential stays out of this sum.
  EXPECT_NEAR(force.z() / (mass_kg * 9.81), 1, 0.05);

  auto weak = EngineOf(hanging("1"));
  StepMany(weak.get(), 300);
  EXPECT_EQ(Bonds(*weak), 0);
  EXPECT_LT(weak->state().position_m[lump.first_particle].z(), -0.05);
}

// Placed into each other, they are pushed out until nothing is inside, without speed from it.
TEST(Carried, OverlappingBallsSeparate) {
  std::string scene = TwoBalls("0");
  for (const char* speed : {", velocity_m_s: [0.1, 0, 0]", ", velocity_m_s: [-0.1, 0.02, 0]"}) {
    const std::size_t at = scene.find(speed);
    ASSERT_NE(at, std::string::npos);
    scene.erase(at, std::string(speed).size());
  }
  const std::size_t at = scene.find("position_m: [-0.0315");
  scene.replace(at, 20, "position_m: [-0.0215");
  auto engine = EngineOf(scene);
  ASSERT_GT(MeasurePenetration(engine->model(), engine->model().rest_position_m).vertices_inside,
            0);
  StepMany(engine.get(), 500);
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
  EXPECT_FALSE(engine->frozen());
  EXPECT_LT(OffItsCarriers(*engine), 1e-13);
}

}  // namespace
}  // namespace adhesim::test
