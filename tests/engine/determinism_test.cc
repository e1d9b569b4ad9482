#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/count_allocations.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

class Contact : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Determinism, Contact, testing::Values(kChurningCells, RubbingCells()),
                         [](const auto& info) { return info.index == 0 ? "Sticks" : "Slides"; });

TEST_P(Contact, GivesTheSameBitsTwiceAndForAnyNumberOfThreads) {
  const auto model = ModelOf(GetParam());
  auto first = EngineOf(model), second = EngineOf(model), threaded = EngineOf(model, 2),
       three = EngineOf(model, 3);
  for (int k = 0; k < 10; ++k) {
    for (Engine* engine : {first.get(), second.get(), threaded.get(), three.get()})
      StepMany(engine, 100);
    EXPECT_EQ(first->StateHash(), second->StateHash());
    EXPECT_EQ(first->StateHash(), threaded->StateHash());
    EXPECT_EQ(first->StateHash(), three->StateHash());
  }
  EXPECT_GT(first->state().contacts.next_zone_id, 5);
}

// The number itself means nothing, and changes when the physics does. That it is one number says
// that optimised and sanitized builds, and every instruction set, compute the same.
TEST(Determinism, EveryBuildGivesTheseBits) {
  auto engine = EngineOf(kChurningCells);
  StepMany(engine.get(), 400);
  EXPECT_EQ(engine->StateHash(), 4795200723095439831ull);
}

// Every set of instructions that the loops are compiled for and that this machine can run.
TEST(Determinism, EveryInstructionSetGivesTheSameBits) {
  const std::vector<Simd> available = AvailableSimd();
  if (available.size() == 1) GTEST_SKIP() << "this machine has the baseline only";
  const auto cells = ModelOf(kChurningCells), needle = ModelOf(NeedleScene(kPressAndPull));
  for (const auto& model : {cells, needle}) {
    auto plain = EngineOf(model, 1, Simd::kBaseline);
    StepMany(plain.get(), 400);
    for (Simd simd : available) {
      SCOPED_TRACE(SimdName(simd));
      for (int threads : {1, 2}) {
        auto engine = EngineOf(model, threads, simd);
        StepMany(engine.get(), 400);
        EXPECT_EQ(engine->StateHash(), plain->StateHash());
        EXPECT_EQ(engine->state().ledger.worst_j, plain->state().ledger.worst_j);
        EXPECT_EQ(engine->state().momentum.scale_angular, plain->state().momentum.scale_angular);
      }
    }
  }
}

TEST(Determinism, AnInstructionSetThatTheMachineLacksIsRefused) {
  if (AvailableSimd().size() == 3) GTEST_SKIP() << "this machine has them all";
  const auto engine = Engine::Create(ModelOf(kChurningCells), {.simd = Simd::kAvx512});
  EXPECT_EQ(engine.status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Determinism, HashSeesASingleBit) {
  auto engine = EngineOf(kChurningCells);
  StepMany(engine.get(), 10);
  const std::uint64_t hash = engine->StateHash();
  State state = engine->state();
  state.position_m[17].y() = std::nextafter(state.position_m[17].y(), 10.0);
  engine->Restore(state);
  EXPECT_NE(engine->StateHash(), hash);
}

TEST_P(Contact, ContinuesARestoredSnapshotWithTheSameBits) {
  auto engine = EngineOf(GetParam());
  StepMany(engine.get(), 700);
  ASSERT_GT(engine->state().contacts.bonds.size(), 0u);
  const State snapshot = engine->state();
  StepMany(engine.get(), 300);
  const std::uint64_t hash = engine->StateHash();
  engine->Restore(snapshot);
  StepMany(engine.get(), 300);
  EXPECT_EQ(engine->StateHash(), hash);
  auto other = EngineOf(GetParam(), 2);  // an engine without any history
  other->Restore(snapshot);
  StepMany(other.get(), 300);
  EXPECT_EQ(other->StateHash(), hash);
}

TEST_P(Contact, AllocatesNothing) {
  auto engine = EngineOf(GetParam());
  Frame frame = engine->MakeFrame();
  engine->TimeStages(100);
  const long before = allocations;
  for (int k = 0; k < 1500; ++k) {
    engine->Step({});
    engine->WriteFrame(&frame);
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GT(engine->state().contacts.next_zone_id, 5);  // contact did happen
}

TEST(Step, AllocatesNothingWithAToolInContact) {
  auto engine = EngineOf(NeedleScene(kPressAndPull));
  Frame frame = engine->MakeFrame();
  const long before = allocations;
  int most = 0;
  for (int k = 0; k < 1200; ++k) {
    engine->Step({});
    engine->WriteFrame(&frame);
    most = std::max(most, frame.tools[0].colliding_particles);
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GE(most, 3);
}

TEST(Step, FreezesOnANonFiniteStateAndSaysSo) {
  auto engine = EngineOf(kChurningCells);
  StepMany(engine.get(), 5);
  State broken = engine->state();
  broken.velocity_m_s[3].x() = std::numeric_limits<double>::quiet_NaN();
  engine->Restore(broken);
  EXPECT_TRUE(engine->Step({}).bits & kStepNonFinite);
  EXPECT_TRUE(engine->frozen());
  // Where, and when: whoever reads it knows where to look.
  EXPECT_THAT(engine->FrozenBecause(), ::testing::HasSubstr("of body '"));
  EXPECT_THAT(engine->FrozenBecause(), ::testing::HasSubstr("is not finite"));
  EXPECT_THAT(engine->FrozenBecause(), ::testing::HasSubstr("after step 6 "));
  const std::uint64_t step = engine->state().step;
  EXPECT_TRUE(engine->Step({}).bits & kStepNonFinite);
  EXPECT_EQ(engine->state().step, step);
  engine->Reset();
  EXPECT_FALSE(engine->frozen());
  EXPECT_EQ(engine->FrozenBecause(), "");
  EXPECT_EQ(StepMany(engine.get(), 5), 0u);
}

}  // namespace
}  // namespace adhesim::test
