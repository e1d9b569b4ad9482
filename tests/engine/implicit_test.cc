// Implicit steps of whole engines: tissue that a tool presses, and bodies that stick and part.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/engine/engine.h"
#include "core/model/diagnostics.h"
#include "tests/support/count_allocations.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/pressed_block.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"
#include "tests/support/tet_block.h"

namespace adhesim {
namespace {

using test::EngineOf;
using test::kCollidingBlocks;
using test::PressedBlock;

// Of the steps of a scene in which a tool holds tissue: the force, what the solver's tolerance
// changed in it (against the same step solved to 1e-13), and the bar.
struct Sample {
  double force_n, error_n, bar_n;
};

std::vector<Sample> SampleForces(PressedBlock pressed) {
  if (kSanitized) pressed.cells = 4;
  auto engine = EngineOf(ModelOf(pressed));
  PressedBlock exact = pressed;
  exact.tolerance = 1e-13;
  auto converged = EngineOf(ModelOf(exact));
  std::vector<Sample> samples;
  Frame frame = engine->MakeFrame();
  for (int k = 0; k < std::lround(1.3 / pressed.dt_s); ++k) {
    converged->Restore(engine->state());
    converged->Step({});
    engine->Step({});
    engine->WriteFrame(&frame);
    const Vec3 force = engine->state().tools[0].tissue.force_n;
    if (frame.tools[0].force_error_n < 0) continue;
    samples.push_back({force.norm(), (force - converged->state().tools[0].tissue.force_n).norm(),
                       frame.tools[0].force_error_n});
  }
  return samples;
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

TEST(ImplicitEngine, ErrorBarCoversTheConvergedForceAndIsNotLargerThanItMustBe) {
  for (const PressedBlock& pressed :
       {PressedBlock{}, PressedBlock{.tolerance = 0.1}, PressedBlock{.dt_s = 2e-3},
        PressedBlock{.stiffness_damping_s = 5e-3}}) {
    const std::vector<Sample> samples = SampleForces(pressed);
    double covered = 0;
    std::vector<double> ratio;
    for (const Sample& s : samples) {
      // The difference itself is known to the round-off of a force of about 1 N in stiff tissue.
      covered += s.bar_n + 1e-11 >= s.error_n;
      if (s.error_n > 1e-10) ratio.push_back(s.bar_n / s.error_n);
    }
    ASSERT_GT(samples.size(), 150u);
    ASSERT_GT(ratio.size(), 100u);
    EXPECT_GE(covered, 0.99 * static_cast<double>(samples.size()));
    EXPECT_LE(Quantile(ratio, 0.5), 10);
  }
}

TEST(ImplicitEngine, DefaultToleranceGivesToolForcesToOnePercent) {
  const std::vector<Sample> samples = SampleForces(PressedBlock{});
  std::vector<double> relative;
  for (const Sample& s : samples) {
    if (s.force_n > 0.1) relative.push_back(s.error_n / s.force_n);
  }
  EXPECT_LE(Quantile(relative, 0.99), 0.01);
}

// Stiffness lags behind rotations in undamped tissue only: next to no damping shows what it does.
TEST(ImplicitEngine, LaggingStiffnessLeavesToolForcesAlone) {
  for (const double dt_s : {1e-3, 5e-3}) {
    PressedBlock pressed{.cells = kSanitized ? 3 : 6, .dt_s = dt_s, .tolerance = 1e-6};
    auto lagging = EngineOf(ModelOf(pressed));
    pressed.stiffness_damping_s = 1e-12;
    auto exact = EngineOf(ModelOf(pressed));
    double peak = 0, difference = 0;
    for (int k = 0; k < std::lround(0.7 / dt_s); ++k) {  // until before it tears
      lagging->Step({});
      exact->Step({});
      const Vec3 force = exact->state().tools[0].tissue.force_n;
      peak = std::max(peak, force.norm());
      difference = std::max(difference, (lagging->state().tools[0].tissue.force_n - force).norm());
    }
    EXPECT_GT(difference, 0);
    EXPECT_LT(difference, 0.01 * peak) << dt_s;
    RecordProperty("difference of the peak, dt " + std::to_string(dt_s),
                   std::to_string(difference / peak));
  }
}

TEST(ImplicitEngine, BooksAndMomentaBalanceWhileAToolPressesAndTears) {
  for (const double damping_s : {0.0, 5e-3}) {
    auto engine = EngineOf(ModelOf(PressedBlock{.stiffness_damping_s = damping_s}));
    double peak = 0;
    for (int k = 0; k < 260; ++k) {
      EXPECT_EQ(engine->Step({}).bits, 0u);
      peak = std::max(peak, engine->state().tools[0].tissue.force_n.norm());
    }
    EXPECT_GT(peak, 1);
    EXPECT_TRUE(engine->state().contacts.zones.empty());
    // Terms by their own formulas, summed over some hundred particles.
    EXPECT_LT(IdentityError(engine->state().ledger), 1e-12);
    // Whatever the tolerance (1 % here).
    EXPECT_LT(MomentumBalance(engine->model(), engine->state()).linear, 1e-11);
    EXPECT_GT(engine->state().ledger.numerical_j, 0);
    if (damping_s > 0) {
      EXPECT_GT(engine->state().ledger.viscous_j, 0);
    }
  }
}

TEST(ImplicitEngine, RestoredStatesGoOnWithTheSameBits) {
  for (const Integrator integrator : {Integrator::kImplicit, Integrator::kNewton}) {
    auto engine = EngineOf(ModelOf(PressedBlock{.cells = 4, .integrator = integrator}));
    for (int k = 0; k < 50; ++k) engine->Step({});
    const State kept = engine->state();
    for (int k = 0; k < 20; ++k) engine->Step({});
    const std::uint64_t hash = engine->StateHash();
    auto other =
        EngineOf(ModelOf(PressedBlock{.cells = 4, .integrator = integrator}), 3, Simd::kBaseline);
    other->Restore(kept);
    for (int k = 0; k < 20; ++k) other->Step({});
    EXPECT_EQ(other->StateHash(), hash);
  }
}

TEST(ImplicitEngine, ErrorBarsBeginAnewWithRestore) {
  auto engine = EngineOf(ModelOf(PressedBlock{.cells = 4}));
  Frame frame = engine->MakeFrame();
  for (int k = 0; k < 50; ++k) engine->Step({});
  const State kept = engine->state();
  std::vector<double> bars;
  for (int run = 0; run < 2; ++run) {
    engine->Restore(kept);
    engine->WriteFrame(&frame);
    EXPECT_LT(frame.tools[0].force_error_n, 0);
    for (int k = 0; k < 5; ++k) engine->Step({});
    engine->WriteFrame(&frame);
    bars.push_back(frame.tools[0].force_error_n);
  }
  EXPECT_GE(bars[0], 0);
  EXPECT_EQ(bars[0], bars[1]);
}

TEST(ImplicitEngine, StepsAllocateNothing) {
  for (const Integrator integrator : {Integrator::kImplicit, Integrator::kNewton}) {
    const auto model = ModelOf(PressedBlock{.cells = 4, .integrator = integrator});
    model->scene.add_effects()->mutable_volume_preservation()->add_bodies("block");
    auto engine = EngineOf(model);
    engine->Step({});
    const long before = test::allocations;
    for (int k = 0; k < 80; ++k) engine->Step({});
    EXPECT_EQ(test::allocations, before);
    EXPECT_FALSE(engine->state().contacts.zones.empty());
  }
}

// Cubes that fall from rest in steps of 50 ms: each step is divided anew by what its trial shows.
TEST(ImplicitEngine, DividedStepsAllocateNothingAndHaveTheSameBitsForAnyThreads) {
  SceneFile file = ReadSceneFile(ADHESIM_SOURCE_DIR "/scenes/stress/youngs_sweep.yaml");
  file.scene.set_rate_hz(20);
  auto engine = EngineOf(test::ModelOf(file));
  const long before = test::allocations;
  for (int k = 0; k < 3; ++k) engine->Step({});
  EXPECT_EQ(test::allocations, before);
  EXPECT_GT(engine->state().contacts.colliding_particles, 0);
  auto other = EngineOf(test::ModelOf(file), 3, Simd::kBaseline);
  for (int k = 0; k < 3; ++k) other->Step({});
  EXPECT_EQ(other->StateHash(), engine->StateHash());
}

TEST(ImplicitEngine, NewtonAndTheLinearStepAgreeOnThePressedForce) {
  const auto force = [](Integrator integrator, double dt_s) {
    auto engine = EngineOf(ModelOf(
        PressedBlock{.cells = 5, .dt_s = dt_s, .tolerance = 1e-9, .integrator = integrator}));
    for (int k = 0; k < std::lround(0.3 / dt_s); ++k) engine->Step({});
    return engine->state().tools[0].tissue.force_n;
  };
  const Vec3 newton = force(Integrator::kNewton, 1.25e-3);
  const double coarse =
      (force(Integrator::kImplicit, 2.5e-3) - force(Integrator::kNewton, 2.5e-3)).norm();
  const double fine = (force(Integrator::kImplicit, 1.25e-3) - newton).norm();
  // Of first order or better in the step, and small in a motion that takes 0.3 s.
  EXPECT_LT(fine, 0.7 * coarse);
  EXPECT_LT(fine, 0.01 * newton.norm());
}

TEST(ImplicitEngine, CaptureAndReleaseConserveMomentum) {
  auto engine = EngineOf(kCollidingBlocks);
  int captures = 0, releases = 0;
  for (int k = 0; k < 200; ++k) {
    const StepReport report = engine->Step({});
    captures += report.captures;
    releases += report.releases;
    EXPECT_EQ(report.bits & (kStepNonFinite | kStepNotConverged), 0u);
  }
  EXPECT_GT(captures, 5);
  EXPECT_GT(releases, 5);
  // Nothing acts from outside.
  EXPECT_LT(MomentumBalance(engine->model(), engine->state()).linear, 1e-12);
  EXPECT_LT(IdentityError(engine->state().ledger), 1e-12);
}

TEST(ImplicitEngine, ASceneMayAskForTheExplicitStep) {
  const std::string scene =
      std::string("integration: {integrator: INTEGRATOR_EXPLICIT}") + kCollidingBlocks;
  auto explicit_engine = EngineOf(scene);
  auto implicit_engine = EngineOf(kCollidingBlocks);
  EXPECT_GT(explicit_engine->substeps(), 1);
  EXPECT_EQ(implicit_engine->substeps(), 1);
  EXPECT_TRUE(explicit_engine->state().velocity_change_m_s.empty());
}

// 50 g on 7 MPa: what the force at the start of a step of 5 ms says would throw the tool about.
TEST(ImplicitEngine, AToolThatPressesStiffTissueComesToRestAtItsCouplingsForce) {
  for (const double max_force_n : {20.0, 3.0}) {
    const std::shared_ptr<Model> model =
        ModelOf(PressedBlock{.cells = 4, .young_modulus_pa = 7e6, .tolerance = 1e-3});
    model->tools[0].coupling.max_force_n = max_force_n;
    auto engine = EngineOf(model);
    double peak_n = 0;
    for (int k = 0; k < 100; ++k) {
      engine->Step({});
      peak_n = std::max(peak_n, engine->state().tools[0].tissue.force_n.norm());
    }
    const ToolState& tool = engine->state().tools[0];
    // Its spring is drawn out by all but what the tissue yields, or pulls with all it may.
    const double stretch_m = (tool.target.position_m - tool.pose.position_m).norm();
    const double spring_n = model->tools[0].coupling.stiffness_n_m * stretch_m;
    EXPECT_GT(stretch_m, 6e-3);
    EXPECT_NEAR(tool.tissue.force_n.norm(), std::min(spring_n, max_force_n), 0.01 * peak_n);
    EXPECT_LT((tool.tissue.force_n + tool.coupling.force_n).norm(), 0.01 * peak_n);
    EXPECT_LT(tool.twist.linear_m_s.norm(), 1e-4);
    // It arrives at a tenth of a metre a second: its momentum in a step is 1 N.
    EXPECT_LT(peak_n, std::min(spring_n, max_force_n) + 1);
  }
}

// It hangs on a tool that is drawn away: together they go as fast as their mass permits.
TEST(ImplicitEngine, AToolDragsAStiffBodyByItsWholeMass) {
  const std::shared_ptr<Model> model =
      ModelOf(PressedBlock{.cells = 3, .young_modulus_pa = 7e6, .tolerance = 1e-4});
  std::fill(model->fixed.begin(), model->fixed.end(), 0);
  ToolModel& tool = model->tools[0];
  tool.coupling.max_force_n = 5;
  tool.coupling.max_speed_m_s = 10;
  tool.start.position_m = Vec3(0.05, 0.05, 0.1015);
  tool.strength = {1e6, 1e6};
  tool.trajectory = {{0.0, tool.start}, {0.05, tool.start}, {0.06, tool.start}};
  tool.trajectory[1].pose.position_m.z() -= 0.001;  // takes hold of its top
  tool.trajectory[2].pose.position_m.z() += 1;
  auto engine = EngineOf(model);
  double impulse = 0, dragged_s = 0;
  for (int k = 0; k < 50; ++k) {
    engine->Step({});
    const double force_n = engine->state().tools[0].coupling.force_n.z();
    impulse += force_n * model->dt_s;
    dragged_s += force_n > 4.99 ? model->dt_s : 0;
  }
  const State& state = engine->state();
  double momentum = tool.coupling.mass_kg * state.tools[0].twist.linear_m_s.z();
  for (int p = 0; p < model->particle_count(); ++p) {
    momentum += model->mass_kg[p] * state.velocity_m_s[p].z();
  }
  ASSERT_FALSE(state.contacts.zones.empty());
  EXPECT_GT(dragged_s, 0.15);
  // The tolerance of the solves, each of which may leave the tool a thousandth of its impulse.
  EXPECT_NEAR(momentum, impulse, 0.005 * impulse);
}

// 7 MPa at 5 ms, turning by 0.06 rad a step: on tangents it would be stretched by 0.18 % in each,
// of 200 times its energy; and what a tolerance of 1 % leaves of such forces would spin it up.
TEST(ImplicitEngine, AStiffBodyThatTurnsKeepsItsEnergyAndItsAngularMomentum) {
  test::TetBlock block;
  block.size_m = {0.03, 0.02, 0.04};
  block.young_modulus_pa = 7e6;
  block.poisson_ratio = 0.45;
  for (const double damping_s : {0.0, 0.01}) {
    block.stiffness_damping_s = damping_s;
    const std::shared_ptr<Model> model = test::ModelOf(block);
    model->dt_s = 5e-3;
    model->integrator = Integrator::kImplicit;
    model->tolerance = 0.01;
    model->max_iterations = 5000;
    for (int p = 0; p < model->particle_count(); ++p) {
      model->initial_velocity_m_s[p] =
          Vec3(1, 0, 0) + Vec3(4, 7, 9).cross(model->rest_position_m[p]);
    }
    auto engine = EngineOf(model);
    const auto angular = [&] {
      Vec3 mass_way = Vec3::Zero(), sum = Vec3::Zero(), momentum = Vec3::Zero();
      double mass = 0;
      for (int p = 0; p < model->particle_count(); ++p) {
        const Vec3 share = model->mass_kg[p] * engine->state().velocity_m_s[p];
        mass += model->mass_kg[p];
        mass_way += model->mass_kg[p] * engine->state().position_m[p];
        momentum += share;
        sum += engine->state().position_m[p].cross(share);
      }
      return Vec3(sum - (mass_way / mass).cross(momentum));
    };
    const Vec3 start = angular();
    const double energy_j = engine->MechanicalEnergy();
    for (int k = 0; k < 200; ++k) {  // two turns
      engine->Step({});
      // Of the energy that it may exchange with strain (0.2 %), and of what it loses to damping.
      EXPECT_NEAR(engine->MechanicalEnergy(), energy_j, 0.01 * energy_j);
    }
    // Balanced to first order in the strain in each step.
    EXPECT_LT((angular() - start).norm(), 0.05 * start.norm());
  }
}

}  // namespace
}  // namespace adhesim
