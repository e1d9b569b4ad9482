// Volumes kept in implicit steps.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/engine/engine.h"
#include "core/model/diagnostics.h"
#include "core/model/volume.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/pressed_block.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"

namespace adhesim {
namespace {

using test::EngineOf;
using test::PressedBall;
using test::PressedBlock;

double VolumeErrorOf(const Engine& engine, int body = 0) {
  const Body& of = engine.model().bodies[body];
  return std::abs(
      EnclosedVolume(engine.model(), of, engine.state().position_m) / of.rest_volume_m3 - 1);
}

// Beyond its sources, of E_ref.
double Gained(const Engine& engine) {
  const Ledger& ledger = engine.state().ledger;
  return (engine.MechanicalEnergy() - ledger.initial_j - ledger.external_work_j -
          ledger.tool_work_j) /
         EnergyReference(ledger);
}

// A volume is met to 1e-13 and positions are that exact; without the constraint the same press
// takes half of it. Momentum is that of some hundred particles, summed over the steps; at first a
// single particle of the ball sticks to the floor, and the ball turns about it.
TEST(ImplicitVolume, ACrushedBallOfTissueKeepsItsVolume) {
  for (const std::string integrator : {"implicit", "newton"}) {
    for (const bool kept : {false, true}) {
      const std::string keeps = kept ? "  - volume_preservation: {bodies: [ball]}\n" : "";
      auto engine = EngineOf(PressedBall(0.3, integrator) + keeps);
      double worst = 0, gained = -1;
      for (int step = 0; step < (kSanitized ? 30 : 150); ++step) {
        EXPECT_EQ(engine->Step({}).bits, 0u);
        worst = std::max(worst, VolumeErrorOf(*engine));
        gained = std::max(gained, Gained(*engine));
      }
      EXPECT_LE(gained, 1e-6) << integrator << kept;  // Newton's tolerance; linear: round-off
      EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
      EXPECT_LE(MomentumBalance(engine->model(), engine->state()).linear,
                integrator == "implicit" ? 1e-11 : 1e-8);  // Newton: what three balances leave
      if (kept) {
        EXPECT_LT(worst, 1e-12);
        EXPECT_NE(engine->state().ledger.volume_j, 0);
      } else {
        EXPECT_GT(worst, 0.1);
      }
    }
  }
}

std::shared_ptr<Model> KeptBlock(const PressedBlock& pressed) {
  std::shared_ptr<Model> model = ModelOf(pressed);
  model->scene.add_effects()->mutable_volume_preservation()->add_bodies("block");
  return model;
}

// The bar that a block without a kept volume has (implicit_test.cc) holds here as well: the rows'
// answer to what the solve leaves open is part of it.
TEST(ImplicitVolume, ErrorBarCoversTheConvergedForce) {
  for (const double tolerance : {0.01, 0.1}) {
    // On so few tetrahedra bars fall short by some per cent at 0.1 (decision 24): not traced.
    if (kSanitized && tolerance > 0.01) continue;
    PressedBlock pressed{.cells = kSanitized ? 3 : 6, .tolerance = tolerance};
    auto engine = EngineOf(KeptBlock(pressed));
    pressed.tolerance = 1e-12;
    auto converged = EngineOf(KeptBlock(pressed));
    Frame frame = engine->MakeFrame();
    int steps = 0, covered = 0;
    std::vector<double> ratio;
    double worst = 0;
    for (int k = 0; k < 200; ++k) {
      converged->Restore(engine->state());
      converged->Step({});
      engine->Step({});
      worst = std::max(worst, VolumeErrorOf(*engine));
      engine->WriteFrame(&frame);
      const double bar = frame.tools[0].force_error_n;
      if (bar < 0) continue;
      const double error =
          (engine->state().tools[0].tissue.force_n - converged->state().tools[0].tissue.force_n)
              .norm();
      ++steps;
      covered += bar + 1e-10 >= error;  // round-off of forces of some newtons in stiff tissue
      if (error > 1e-9) ratio.push_back(bar / error);
    }
    ASSERT_GT(steps, 100);
    ASSERT_GT(ratio.size(), 60u);
    EXPECT_GE(covered, 0.99 * steps) << tolerance;
    std::nth_element(ratio.begin(), ratio.begin() + ratio.size() / 2, ratio.end());
    EXPECT_LE(ratio[ratio.size() / 2], 10);
    EXPECT_LT(worst, 1e-12);
    EXPECT_LT(MomentumBalance(engine->model(), engine->state()).linear, 1e-11);
    EXPECT_LT(IdentityError(engine->state().ledger), 1e-12);
  }
}

// One row each, joined by zones.
TEST(ImplicitVolume, BlocksThatStickAndPartKeepTheirVolumesAndGainNothing) {
  for (const std::string integrator : {"implicit", "newton"}) {
    auto engine =
        EngineOf("integration: {integrator: " + integrator + "}" + test::kCollidingBlocks +
                 "  - volume_preservation: {bodies: [left, right]}\n");
    double worst = 0, gained = -1;
    int captures = 0, releases = 0;
    for (int k = 0; k < 150; ++k) {
      const StepReport report = engine->Step({});
      EXPECT_EQ(report.bits & (kStepNonFinite | kStepNotConverged | kStepVolumeNotMet), 0u);
      captures += report.captures;
      releases += report.releases;
      worst = std::max({worst, VolumeErrorOf(*engine, 0), VolumeErrorOf(*engine, 1)});
      gained = std::max(gained, Gained(*engine));
    }
    EXPECT_GT(captures, 5);
    EXPECT_GT(releases, 5);
    EXPECT_LT(worst, 1e-12);
    EXPECT_LT(gained, 1e-6);
    EXPECT_LT(MomentumBalance(engine->model(), engine->state()).linear, 1e-12);
    EXPECT_LT(IdentityError(engine->state().ledger), 1e-12);
  }
}

// nu is 0.45 here: a little more resistance is left to gain, and no more than between nu 0.45 and
// 1/2 of a flat punch (1 / (1 - nu^2): 6 %), beside the bottom's.
TEST(ImplicitVolume, IsFeltByATool) {
  double force[2];
  for (const bool kept : {false, true}) {
    const PressedBlock pressed{.cells = 4, .tolerance = 1e-6};
    auto engine = EngineOf(kept ? KeptBlock(pressed) : std::shared_ptr<Model>(ModelOf(pressed)));
    for (int k = 0; k < 90; ++k) engine->Step({});
    force[kept] = engine->state().tools[0].tissue.force_n.norm();
  }
  EXPECT_GT(force[1], 1.02 * force[0]);
  EXPECT_LT(force[1], 1.15 * force[0]);
}

// The frame's local stiffness against what a small step of the tool costs: the tool is held still,
// and then told to be a little further on.
TEST(ImplicitVolume, IsPartOfTheLocalStiffness) {
  double stiffness[2];
  for (const bool kept : {false, true}) {
    const PressedBlock pressed{.cells = 4, .tolerance = 1e-9};
    auto engine = EngineOf(kept ? KeptBlock(pressed) : std::shared_ptr<Model>(ModelOf(pressed)));
    for (int k = 0; k < 90; ++k) engine->Step({});
    Frame frame = engine->MakeFrame();
    engine->WriteFrame(&frame);
    stiffness[kept] = std::abs(frame.tools[0].stiffness_n_m(2, 2));
  }
  EXPECT_GT(stiffness[1], 1.02 * stiffness[0]);
  EXPECT_LT(stiffness[1], 1.5 * stiffness[0]);
}

TEST(ImplicitVolume, RestoredStatesGoOnWithTheSameBits) {
  auto engine = EngineOf(KeptBlock({.cells = 3}));
  for (int k = 0; k < 50; ++k) engine->Step({});
  const State kept = engine->state();
  for (int k = 0; k < 10; ++k) engine->Step({});
  auto other = EngineOf(KeptBlock({.cells = 3}), 3, Simd::kBaseline);
  other->Restore(kept);
  for (int k = 0; k < 10; ++k) other->Step({});
  EXPECT_EQ(other->StateHash(), engine->StateHash());
}

// What no iteration can meet is reported, and the step stays finite.
TEST(ImplicitVolume, AFlatBodyStaysFinite) {
  for (const Integrator integrator : {Integrator::kImplicit, Integrator::kNewton}) {
    std::shared_ptr<Model> model = KeptBlock({.cells = 3, .integrator = integrator});
    model->tools.clear();
    auto engine = EngineOf(model);
    State state = engine->state();
    for (Vec3& x : state.position_m) x.z() *= 1e-3;
    engine->Restore(state);
    std::uint32_t bits = 0;
    for (int k = 0; k < 200; ++k) bits |= engine->Step({}).bits;
    EXPECT_EQ(bits & kStepNonFinite, 0u);
  }
}

// A block mirrored in its bottom: rows along the gradients of where it starts lead its first steps
// away. The last change of multipliers is taken back then, and what is left (3e-11 of the volume)
// the rest of the step meets; 8e-9 was left and reported where it was kept.
TEST(ImplicitVolume, WhatLeadsAwayIsTakenBack) {
  std::shared_ptr<Model> model = KeptBlock({.cells = 3});
  model->tools.clear();
  std::fill(model->fixed.begin(), model->fixed.end(), 0);
  auto engine = EngineOf(model);
  State state = engine->state();
  for (Vec3& x : state.position_m) x.z() *= -1;
  engine->Restore(state);
  double worst = 0;
  for (int k = 0; k < 10; ++k) {
    engine->Step({});
    worst = std::max(worst, VolumeErrorOf(*engine));
  }
  EXPECT_LT(worst, 1e-9);
}

// Their responses would not fit into memory.
TEST(ImplicitVolume, TooManyBodiesAreRefused) {
  const std::shared_ptr<const Model> model = test::ModelOf(R"(
bodies:
  - name: crumb
    block: {size_m: [0.01, 0.01, 0.01]}
    tetrahedra: {cells: 1}
    density_kg_m3: 1000
    copies: {count: 1100, spacing_m: 0.02}
effects:
  - elasticity: {young_modulus_pa: 3000, poisson_ratio: 0.4}
  - volume_preservation: {bodies: [crumb]}
)");
  auto engine = Engine::Create(model, {});
  ASSERT_FALSE(engine.ok());
  EXPECT_NE(engine.status().message().find("volume_preservation of 1100 bodies"), std::string::npos)
      << engine.status();
}

// A cube in a cup, its open side under a flat tool: nothing of its surface is free to give way.
// All that is free is under the tool. In the step in which it is caught while it crosses nothing
// can keep the volume, and that is said; after that the tool does not get any further.
TEST(ImplicitVolume, IsHeldUnderAToolThatCoversAllThatIsFree) {
  const std::string sides =
      "{half_space: {point_m: [-0.0149, 0, 0], normal: [1, 0, 0]}}, "
      "{half_space: {point_m: [0.0149, 0, 0], normal: [-1, 0, 0]}}, "
      "{half_space: {point_m: [0, -0.0149, 0], normal: [0, 1, 0]}}, "
      "{half_space: {point_m: [0, 0.0149, 0], normal: [0, -1, 0]}}, "
      "{half_space: {point_m: [0, 0, -0.0149], normal: [0, 0, 1]}}";
  auto engine = EngineOf(R"(
rate_hz: 200
bodies:
  - {name: a, block: {size_m: [0.03, 0.03, 0.03]}, tetrahedra: {cells: 3}, density_kg_m3: 1000, fixed: [)" +
                         sides + R"(]}
tools:
  - name: t
    needle: {length_m: 0.1, radius_m: 0.012, tip_length_m: 0.001}
    position_m: [0.0005, 0.0007, 0.02]
    coupling: {stiffness_n_m: 10000, max_force_n: 100, mass_kg: 0.01}
    trajectory:
      - {t_s: 0, position_m: [0.0005, 0.0007, 0.02]}
      - {t_s: 0.2, position_m: [0.0005, 0.0007, 0]}
effects:
  - elasticity: {young_modulus_pa: 1000, poisson_ratio: 0.3, stiffness_damping_s: 0.002}
  - volume_preservation: {bodies: [a]}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 500}
)");
  bool lost = false;
  for (int k = 0; k < 60; ++k) {
    const std::uint32_t bits = engine->Step({}).bits;
    EXPECT_LT(VolumeErrorOf(*engine), 0.01) << k;  // 0.3 mm of 30
    const bool now = VolumeErrorOf(*engine) > 1e-6;
    EXPECT_TRUE(!now || (bits & kStepVolumeNotMet)) << k;
    lost = lost || now;
  }
  EXPECT_TRUE(lost);
  EXPECT_NEAR(engine->state().tools[0].tissue.force_n.z(), 100, 1);
}

}  // namespace
}  // namespace adhesim
