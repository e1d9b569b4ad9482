#include "core/effects/drying/drying.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/model/bond_geometry.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

constexpr double kGain = 3, kTimeConstantS = 0.05;

double Law(double age_s) { return 1 + (kGain - 1) * (1 - std::exp(-age_s / kTimeConstantS)); }

// A rigid block of 1 kg that touches a fixed plate from below and hangs on it by 500 Pa.
std::string Hanging(double gravity_m_s2, bool dries = true) {
  return R"(
bodies:
  - {name: plate, sheet: {length_m: 0.2, width_m: 0.2, columns: 5, rows: 5}, mass_kg: 1, fixed: [all: true]}
  - {name: block, kind: rigid, block: {size_m: [0.04, 0.04, 0.04], cells: 2}, mass_kg: 1, position_m: [0.003, 0.002, -0.0205],
     velocity_m_s: [0, 0, 0.02]}
effects:
  - uniform_gravity: {acceleration_m_s2: [0, 0, )" +
         std::to_string(-gravity_m_s2) +
         "]}\n  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 500}\n" +
         (dries ? "  - drying: {gain: 3, time_constant_s: 0.05}\n" : "");
}

// Whether the block still hangs when this pull sets in on it as it is.
bool Holds(const State& state, double pull_m_s2, bool dries = true) {
  auto engine = EngineOf(Hanging(pull_m_s2, dries));
  engine->Restore(state);
  StepMany(engine.get(), 2);
  return !engine->state().contacts.bonds.empty();
}

TEST(Drying, PullOffForceFollowsTheLawOfItsAge) {
  auto engine = EngineOf(Hanging(0));
  StepMany(engine.get(), 1);
  ASSERT_FALSE(engine->state().contacts.bonds.empty()) << "they never met";
  // What a new contact carries, to 1e-4 of it.
  double holds = 0, falls = 100;
  while (falls - holds > 1e-4 * falls) {
    const double pull = 0.5 * (holds + falls);
    (Holds(engine->state(), pull, false) ? holds : falls) = pull;
  }
  for (const int steps : {1, 24, 25, 50, 400}) {  // after 1, 25, 50, 100 and 500
    StepMany(engine.get(), steps);
    // The pull tries the bond in two steps, and the law grows by at most (g - 1) dt / tau = 4 % in
    // one: the ages at both.
    const double age_s = engine->state().time_s - engine->state().contacts.bonds[0].since_s;
    EXPECT_TRUE(Holds(engine->state(), 0.999 * holds * Law(age_s))) << age_s;
    EXPECT_FALSE(Holds(engine->state(), 1.001 * holds * Law(age_s + 1e-3))) << age_s;
    EXPECT_FALSE(Holds(engine->state(), 1.001 * holds * kGain)) << "stronger than g s_0";
  }
}

TEST(Drying, IsAFactorOfEveryLimitOfItsBond) {
  const auto model = ModelOf(Hanging(0));
  const DryingEffect drying(*model, model->scene.effects(2).drying());
  std::vector<Bond> bonds(300);
  for (std::size_t b = 0; b < bonds.size(); ++b) bonds[b].since_s = -0.01 * static_cast<double>(b);
  drying.ScaleStrengths(0, bonds);
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    // Two exponentials that are good to 1e-15.
    EXPECT_NEAR(bonds[b].strength_scale, Law(0.01 * static_cast<double>(b)), 1e-14);
    EXPECT_LE(bonds[b].strength_scale, kGain);
    bonds[b].particle = model->bodies[1].first_particle;
    bonds[b].triangle = 0;
    const BondLimit limit = LimitOf(bonds[b], bonds[b].particle, *model);
    const double new_n = 500 * model->area_m2[bonds[b].particle];
    EXPECT_NEAR(limit.normal_n, bonds[b].strength_scale * new_n, 1e-15 * kGain * new_n);
    EXPECT_NEAR(limit.shear_n, bonds[b].strength_scale * new_n, 1e-15 * kGain * new_n);
  }
}

// Ages are part of the state: a snapshot in the middle of drying goes on as if nothing had been.
TEST(Drying, SnapshotsCarryAges) {
  auto engine = EngineOf(Hanging(0.5));
  StepMany(engine.get(), 30);
  const State snapshot = engine->state();
  ASSERT_FALSE(snapshot.contacts.bonds.empty());
  StepMany(engine.get(), 30);
  const double scale = engine->state().contacts.bonds[0].strength_scale;
  EXPECT_GT(scale, snapshot.contacts.bonds[0].strength_scale);
  engine->Reset();
  StepMany(engine.get(), 5);
  engine->Restore(snapshot);
  StepMany(engine.get(), 30);
  EXPECT_EQ(engine->state().contacts.bonds[0].strength_scale, scale);
}

// Cells that spin, meet and part for 0.3 s, by an adhesive that is twice as strong after 20 ms.
const std::string kChurningWhileItDries =
    std::string(kChurningCells) + "  - drying: {gain: 3, time_constant_s: 0.03}\n";

// An engine that knows nothing of what was goes on with the same bits, because ages are in the
// state; and the hash is that of what will be: it sees an age that differs.
TEST(Drying, SnapshotsContinueWithTheSameBits) {
  auto engine = EngineOf(kChurningWhileItDries);
  StepMany(engine.get(), 500);
  const State snapshot = engine->state();
  ASSERT_FALSE(snapshot.contacts.bonds.empty());
  const std::uint64_t hash_then = engine->StateHash();
  int releases = 0;
  for (int k = 0; k < 300; ++k) releases += engine->Step({}).releases;
  ASSERT_GT(releases, 0) << "no strength mattered";
  const std::uint64_t hash = engine->StateHash();
  auto other = EngineOf(kChurningWhileItDries, 2);
  other->Restore(snapshot);
  EXPECT_EQ(other->StateHash(), hash_then);
  StepMany(other.get(), 300);
  EXPECT_EQ(other->StateHash(), hash);

  State older = snapshot;
  for (Bond& bond : older.contacts.bonds) bond.since_s -= 0.1;
  other->Restore(older);
  EXPECT_NE(other->StateHash(), hash_then);
  StepMany(other.get(), 300);
  EXPECT_NE(other->StateHash(), hash);
}

TEST(Drying, BeginsAnewWhereAContactTakesHoldAgain) {
  auto engine = EngineOf(Hanging(0));
  StepMany(engine.get(), 200);
  ASSERT_GT(engine->state().contacts.bonds[0].strength_scale, 2.9);
  // Torn off by a pull far above its strength, further than the release distance, and driven back.
  auto pulled = EngineOf(Hanging(100));
  pulled->Restore(engine->state());
  StepMany(pulled.get(), 8);
  ASSERT_TRUE(pulled->state().contacts.bonds.empty());
  const double parted_s = pulled->state().time_s;
  auto driven = EngineOf(Hanging(-100));
  driven->Restore(pulled->state());
  StepMany(driven.get(), 60);
  ASSERT_FALSE(driven->state().contacts.bonds.empty());
  for (const Bond& bond : driven->state().contacts.bonds) EXPECT_GE(bond.since_s, parted_s);
}

TEST(Drying, DoesNotAgeWhatSlides) {
  const auto model = ModelOf(Hanging(0));
  std::vector<Bond> bonds(2);
  bonds[0].sliding = true;
  DryingEffect(*model, model->scene.effects(2).drying()).ScaleStrengths(10, bonds);
  EXPECT_EQ(bonds[0].strength_scale, 1);
  EXPECT_EQ(bonds[1].strength_scale, kGain);  // after 200 time constants
}

TEST(Drying, NeedsAnAdhesiveThatCanDry) {
  const SceneFile file = ParseScene(
      "bodies:\n  - {name: a, icosphere: {radius_m: 0.5}, mass_kg: 1}\n"
      "effects:\n  - drying: {gain: 3, time_constant_s: 1}\n",
      "test.yaml", "");
  EXPECT_THAT(file.Format(file.problems),
              testing::HasSubstr("test.yaml:4:5: error: effects[0].drying: needs the effect "
                                 "virtual_adhesive, and the scene has none"));
}

}  // namespace
}  // namespace adhesim::test
