// Steps that do without something to save time: how far they are from full ones, and what they
// keep.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/contact/penetration.h"
#include "core/engine/engine.h"
#include "core/model/diagnostics.h"
#include "tests/support/count_allocations.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/pressed_block.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"

namespace adhesim {
namespace {

using test::EngineOf;
using test::PressedBlock;

std::vector<std::string> RungNames(const Engine& engine) {
  std::vector<std::string> names;
  for (const FidelityRung& rung : engine.rungs()) names.push_back(rung.name);
  return names;
}

std::string Needle() { return test::NeedleScene(test::kPressAndPull); }

// Down rung by rung and back, all along the run: so that changes fall into pressing, holding and
// letting go.
int ScriptedRung(int step, int rungs) {
  const int phase = (step / 7) % (2 * rungs);
  return phase <= rungs ? phase : 2 * rungs - phase;
}

TEST(Fidelity, IsLoweredInTheOrderThatASceneHas) {
  const std::vector<std::string> none;
  EXPECT_EQ(RungNames(*EngineOf(ModelOf(PressedBlock{.cells = 2, .tolerance = 1e-3}))),
            (std::vector<std::string>{"iterations", "detection", "stiffness"}));
  EXPECT_EQ(
      RungNames(*EngineOf(ModelOf(PressedBlock{.cells = 2, .integrator = Integrator::kNewton}))),
      (std::vector<std::string>{"iterations", "detection"}));
  EXPECT_EQ(RungNames(*EngineOf(test::kChurningCells)),
            (std::vector<std::string>{"iterations", "detection"}));
  // Sliding contacts follow what is near in every sub-step.
  EXPECT_EQ(RungNames(*EngineOf(test::RubbingCells())), std::vector<std::string>{"iterations"});
  EXPECT_EQ(RungNames(*EngineOf(R"(
bodies: [{name: a, icosphere: {radius_m: 0.6}, mass_kg: 1}]
effects: [{shape_memory: {stiffness_n_m: 60}}]
)")),
            none);
}

// Those that a study wrote into the scene; bounds of the others.
TEST(Fidelity, DeclaresWhatWasMeasuredOnTheScene) {
  const std::string rungs = "rungs:\n  iterations: {force_error: 0.02, position_error: 3e-7}\n";
  const auto engine = EngineOf(rungs + Needle());
  ASSERT_EQ(engine->rungs().size(), 2u);
  EXPECT_TRUE(engine->rungs()[0].measured);
  EXPECT_EQ(engine->rungs()[0].force_error, 0.02);
  EXPECT_EQ(engine->rungs()[0].position_error, 3e-7);
  const FidelityRung bound = EngineOf(Needle())->rungs()[1];
  EXPECT_FALSE(engine->rungs()[1].measured);
  EXPECT_EQ(engine->rungs()[1].force_error, bound.force_error);
  EXPECT_EQ(engine->rungs()[1].position_error, bound.position_error);
  EXPECT_GT(bound.force_error, 0);
  const auto refused = Engine::Create(
      test::ModelOf("rungs: {stiffness: {force_error: 0.02, position_error: 0}}\n" + Needle()), {});
  EXPECT_EQ(refused.status().message(),
            "rungs.stiffness: the scene has no such rung to give up; permitted: iterations, "
            "detection");
}

TEST(Fidelity, KeepsToTheRungsThatThereAre) {
  auto engine = EngineOf(test::kChurningCells);
  engine->SetFidelity(100);
  EXPECT_EQ(engine->fidelity(), 2);
  engine->SetFidelity(-1);
  EXPECT_EQ(engine->fidelity(), 0);
}

// Largest difference of the tool's force from that of a run at full fidelity, and largest change of
// it in a step that follows a change of rungs, beyond what the full run changed there: parts of the
// peak.
struct ForceChange {
  double difference = 0, jump = 0;
};
ForceChange ChangeOfForce(Engine* full, Engine* lowered, int steps) {
  const int rungs = static_cast<int>(lowered->rungs().size());
  double peak = 0;
  ForceChange change;
  Vec3 full_before = Vec3::Zero(), before = Vec3::Zero();
  for (int step = 0; step < steps; ++step) {
    const int last = lowered->fidelity();
    lowered->SetFidelity(ScriptedRung(step, rungs));
    full->Step({});
    EXPECT_FALSE(lowered->Step({}).bits & kStepNonFinite);
    const Vec3 expected = full->state().tools[0].tissue.force_n;
    const Vec3 force = lowered->state().tools[0].tissue.force_n;
    peak = std::max(peak, expected.norm());
    change.difference = std::max(change.difference, (force - expected).norm());
    if (lowered->fidelity() != last) {
      change.jump = std::max(change.jump, ((force - before) - (expected - full_before)).norm());
    }
    full_before = expected;
    before = force;
  }
  EXPECT_GT(peak, 0.1);
  return {change.difference / peak, change.jump / peak};
}

// Until the needle lets go: when that is depends on the force, and then one of two runs feels
// nothing.
TEST(Fidelity, ChangesMakeNoJumpInTheForceOnATool) {
  const int cells = kSanitized ? 4 : 7;
  for (const Integrator integrator : {Integrator::kImplicit, Integrator::kNewton}) {
    const PressedBlock pressed{.cells = integrator == Integrator::kNewton ? 4 : cells,
                               .tolerance = 1e-3,
                               .integrator = integrator};
    auto full = EngineOf(ModelOf(pressed)), lowered = EngineOf(ModelOf(pressed));
    const ForceChange change = ChangeOfForce(full.get(), lowered.get(), kSanitized ? 70 : 170);
    EXPECT_LT(change.jump, 0.05);
    EXPECT_LT(change.difference, lowered->rungs().back().force_error);
  }
  auto full = EngineOf(Needle()), lowered = EngineOf(Needle());
  const ForceChange change = ChangeOfForce(full.get(), lowered.get(), kSanitized ? 150 : 450);
  EXPECT_LT(change.jump, 0.05);
  EXPECT_LT(change.difference, lowered->rungs().back().force_error);
}

TEST(Fidelity, GivesTheSameBitsForAnyThreadsAndInstructionSet) {
  const auto hash_of = [](std::shared_ptr<const Model> model, int threads, Simd simd) {
    auto engine = EngineOf(std::move(model), threads, simd);
    for (int step = 0; step < 120; ++step) {
      engine->SetFidelity(ScriptedRung(step, static_cast<int>(engine->rungs().size())));
      engine->Step({});
    }
    return engine->StateHash();
  };
  for (const std::shared_ptr<const Model>& model :
       {std::shared_ptr<const Model>(ModelOf(PressedBlock{.cells = 4, .tolerance = 1e-3})),
        test::ModelOf(std::string(test::kChurningCells))}) {
    const std::uint64_t hash = hash_of(model, 1, BestSimd());
    EXPECT_EQ(hash_of(model, 3, BestSimd()), hash);
    EXPECT_EQ(hash_of(model, 2, Simd::kBaseline), hash);
  }
}

// The engine is Reset() in the midst of it: nothing kept from before may show.
TEST(Fidelity, ResetBeginsAnew) {
  for (const std::shared_ptr<const Model>& model :
       {std::shared_ptr<const Model>(ModelOf(PressedBlock{.cells = 3, .tolerance = 1e-3})),
        test::ModelOf(std::string(test::kChurningCells))}) {
    auto engine = EngineOf(model);
    engine->SetFidelity(100);
    test::StepMany(engine.get(), 60);
    const std::uint64_t hash = engine->StateHash();
    test::StepMany(engine.get(), 33);
    engine->Reset();
    test::StepMany(engine.get(), 60);
    EXPECT_EQ(engine->StateHash(), hash);
  }
}

// Asking for the energy looks at contacts, and must leave those that the steps keep alone.
TEST(Fidelity, IsNotChangedByThoseWhoLook) {
  auto seen = EngineOf(test::kChurningCells), unseen = EngineOf(test::kChurningCells);
  for (Engine* engine : {seen.get(), unseen.get()}) engine->SetFidelity(2);
  for (int step = 0; step < 300; ++step) {
    seen->Step({});
    unseen->Step({});
    EXPECT_GT(seen->MechanicalEnergy(), 0);
  }
  EXPECT_EQ(seen->StateHash(), unseen->StateHash());
}

TEST(Fidelity, LoweredStepsLetNothingPassAndKeepTheBooks) {
  auto engine = EngineOf(test::kChurningCells);
  engine->SetFidelity(2);
  double volume_error = 0;
  for (int step = 0; step < (kSanitized ? 600 : 1500); ++step) {
    engine->Step({});
    volume_error = std::max(volume_error, *VolumeError(engine->model(), engine->state()));
    if (step % 20 != 19) continue;
    const std::vector<Vec3>& x = engine->state().position_m;
    ASSERT_EQ(MeasurePenetration(engine->model(), x).vertices_inside, 0) << "step " << step;
    ASSERT_EQ(CountEdgesThrough(engine->model(), x), 0) << "step " << step;
  }
  EXPECT_LT(volume_error, 1e-6);  // its own tolerance: errors of steps do not add up
  EXPECT_LT(IdentityError(engine->state().ledger), 1e-9);
  EXPECT_LT(MomentumBalance(engine->model(), engine->state()).linear, 1e-9);
  EXPECT_GT(engine->state().ledger.captured_j, 0);
  engine->SetFidelity(0);
  test::StepMany(engine.get(), 2);
  // Round-off of the volume again.
  EXPECT_LT(*VolumeError(engine->model(), engine->state()), 1e-12);
}

TEST(Fidelity, AllocatesNothingWhenItChanges) {
  for (const std::shared_ptr<const Model>& model :
       {std::shared_ptr<const Model>(ModelOf(PressedBlock{.cells = 3, .tolerance = 1e-3})),
        test::ModelOf(std::string(test::kChurningCells))}) {
    auto engine = EngineOf(model);
    const int rungs = static_cast<int>(engine->rungs().size());
    const long before = test::allocations;
    for (int step = 0; step < 100; ++step) {
      engine->SetFidelity(ScriptedRung(step, rungs));
      engine->Step({});
    }
    EXPECT_EQ(test::allocations, before);
  }
}

// 0.06 rad a step: stiffness of the step before would be that far behind, and spins it up, free
// or about the particle in its middle.
TEST(Fidelity, AStiffBodyThatTurnsKeepsItsEnergyWithEveryRungGivenUp) {
  for (const std::string held : {"", ", fixed: [ball: {centre_m: [0, 0, 0], radius_m: 0.004}]"}) {
    auto engine = EngineOf(R"(
rate_hz: 200
bodies:
  - {name: a, block: {size_m: [0.03, 0.03, 0.03]}, tetrahedra: {cells: 4}, density_kg_m3: 1000, angular_velocity_rad_s: [4, 5, 10])" +
                           held + R"(}
effects:
  - elasticity: {young_modulus_pa: 7e6, poisson_ratio: 0.45, stiffness_damping_s: 0.002}
)");
    const double start = engine->MechanicalEnergy();
    engine->SetFidelity(static_cast<int>(engine->rungs().size()));
    EXPECT_EQ(RungNames(*engine).back(), "stiffness");
    for (int step = 0; step < 40; ++step) {
      engine->Step({});
      EXPECT_LT(engine->MechanicalEnergy(), 1.02 * start) << step << held;
    }
  }
}

}  // namespace
}  // namespace adhesim
