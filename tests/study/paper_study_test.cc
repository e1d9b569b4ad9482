#include "core/study/paper_study.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/study/rolling.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

StudyOptions Options(double duration_s, int samples) {
  StudyOptions options;
  options.duration_s = duration_s;
  options.samples = samples;
  return options;
}

TEST(PaperStudy, SamplesFromTheStartToTheEnd) {
  const auto engine = EngineOf(kChurningCells);
  StudyOptions options = Options(0.1, 7);
  options.instants = {0, 0.5, 1};
  std::vector<std::uint64_t> steps;
  options.at_instant = [&] { steps.push_back(engine->state().step); };
  const PaperStudy study = RunPaperStudy(engine.get(), options);
  EXPECT_EQ(study.steps, 100u);
  ASSERT_EQ(study.samples.size(), 8u);
  EXPECT_EQ(study.samples.front().time_s, 0);
  EXPECT_NEAR(study.samples.back().time_s, 0.1, 1e-12);  // a sum of 100 roundings
  for (std::size_t i = 1; i < study.samples.size(); ++i) {
    EXPECT_GT(study.samples[i].time_s, study.samples[i - 1].time_s);
    EXPECT_GT(study.samples[i].cpu_ms, 0);
  }
  EXPECT_EQ(steps, (std::vector<std::uint64_t>{0, 50, 100}));
  ASSERT_EQ(study.instants.size(), 3u);
  EXPECT_NEAR(study.instants[1].time_s, 0.05, 1e-12);
  EXPECT_GT(study.cpu_ms_median, 0);
  EXPECT_GE(study.cpu_ms_p99, study.cpu_ms_median);
}

TEST(PaperStudy, TakesNoMoreSamplesThanSteps) {
  const auto engine = EngineOf(kChurningCells);
  EXPECT_EQ(RunPaperStudy(engine.get(), Options(0.003, 200)).samples.size(), 4u);
}

TEST(PaperStudy, SeesContactThatTakesEnergyAndAddsNone) {
  const auto engine = EngineOf(kChurningCells);
  const PaperStudy study = RunPaperStudy(engine.get(), Options(1, 20));
  const StudySample& last = study.samples.back();
  EXPECT_GT(last.colliding_particles, 0);
  EXPECT_GT(last.captured_j, 0);
  EXPECT_LE(last.contact_added_j, 1e-9 * study.reference_j);  // the bound
  EXPECT_GE(last.group_bodies, 2);
  ASSERT_TRUE(last.mean_gap_m);
  EXPECT_GT(*last.mean_gap_m, 0);
  ASSERT_TRUE(last.max_depth_m);
  ASSERT_TRUE(last.volume_error);
}

TEST(PaperStudy, StopsWhenAsked) {
  const auto engine = EngineOf(kChurningCells);
  StudyOptions options = Options(1, 10);
  options.stop = [&] { return engine->state().step >= 5; };
  const PaperStudy study = RunPaperStudy(engine.get(), options);
  EXPECT_TRUE(study.interrupted);
  EXPECT_EQ(study.steps, 5u);
}

TEST(PaperStudy, OneBodyHasNeitherPartnerNorOverlap) {
  const auto engine = EngineOf(
      "bodies:\n  - {name: ball, icosphere: {radius_m: 0.6}, mass_kg: 1}\n"
      "effects:\n  - uniform_gravity: {}\n  - shape_memory: {stiffness_n_m: 60}\n");
  const PaperStudy study = RunPaperStudy(engine.get(), Options(0.02, 2));
  const StudySample& last = study.samples.back();
  EXPECT_FALSE(last.separation_m || last.mean_gap_m || last.max_depth_m || last.volume_error);
  EXPECT_FALSE(study.capture_distance_m);
  EXPECT_EQ(last.group_bodies, 1);
  EXPECT_NEAR(*study.smallest_radius_m, 0.6, 1e-12);  // a vertex of the sphere, rounded
}

TEST(PaperStudy, FollowsABody) {
  const auto engine = EngineOf(
      "bodies:\n  - {name: ball, icosphere: {radius_m: 0.6}, mass_kg: 1, velocity_m_s: [0, 2, "
      "0]}\n");
  StudyOptions options = Options(0.5, 2);
  options.followed_body = "ball";
  const StudySample last = RunPaperStudy(engine.get(), options).samples.back();
  EXPECT_NEAR(last.moved_m.value_or(0), 1, 1e-12);  // 500 roundings
  EXPECT_NEAR(last.speed_m_s.value_or(0), 2, 1e-12);
}

// Two bars that cross with an edge each: the pair's points lie on the edges.
TEST(PaperStudy, TheGapOfEdgesIsBetweenTheirPoints) {
  const auto engine = EngineOf(
      "bodies:\n"
      "  - {name: a, kind: rigid, block: {size_m: [1, 0.2, 0.2], cells: 1}, mass_kg: 1, "
      "rotation_deg: [45, 0, 0]}\n"
      "  - {name: b, kind: rigid, block: {size_m: [0.2, 1, 0.2], cells: 1}, mass_kg: 1, "
      "rotation_deg: [0, 45, 0], position_m: [0.03, 0.02, 0.29], velocity_m_s: [0, 0, -0.1]}\n"
      "effects:\n"
      "  - virtual_adhesive: {capture_distance_m: 0.005}\n");
  const PaperStudy study = RunPaperStudy(engine.get(), Options(0.2, 5));
  const auto& bonds = engine->state().contacts.bonds;
  ASSERT_TRUE(
      std::any_of(bonds.begin(), bonds.end(), [](const Bond& b) { return b.partner >= 0; }));
  ASSERT_TRUE(study.samples.back().mean_gap_m);
  EXPECT_LE(*study.samples.back().mean_gap_m, 0.005);
}

// Pushing apart what overlaps at the start is not contact's work; it counts as put in.
TEST(PaperStudy, TellsWhatPushingApartBroughtBesideContact) {
  const auto engine = EngineOf(
      "bodies:\n"
      "  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1}\n"
      "  - {name: b, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.9, 0.1, 0]}\n"
      "effects:\n"
      "  - shape_memory: {stiffness_n_m: 60, damping_n_s_m: 0.2}\n"
      "  - virtual_adhesive: {capture_distance_m: 0.012}\n");
  const PaperStudy study = RunPaperStudy(engine.get(), Options(1, 50));
  const StudySample& last = study.samples.back();
  EXPECT_GT(last.pushed_j, 0);
  EXPECT_EQ(last.pushed_j, engine->state().ledger.correction_j);
  EXPECT_LE(last.contact_added_j, 1e-9 * study.reference_j);
  EXPECT_LE(EnergyExcess(study), 0.01);  // the project's bound for an explicit step
  EXPECT_EQ(BodiesExcess(study), EnergyExcess(study));
}

// Cells that come within the reach of impulses gain what the impulses lend.
TEST(PaperStudy, TellsTheBodiesEnergyApartFromThatOfContact) {
  const auto engine = EngineOf(
      "bodies:\n"
      "  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1, velocity_m_s: [0.2, 0, 0]}\n"
      "  - {name: b, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [1.23, 0, 0], "
      "velocity_m_s: [-0.2, 0, 0]}\n"
      "effects:\n"
      "  - shape_memory: {stiffness_n_m: 60}\n"
      "  - attraction_impulses: {stick_distance_m: 0.02, stick_stiffness_n_m: 500, "
      "contact_stiffness_n_m: 500}\n");
  const PaperStudy study = RunPaperStudy(engine.get(), Options(0.2, 100));
  ASSERT_TRUE(study.samples.front().bodies_energy_j);
  EXPECT_NEAR(*study.samples.front().bodies_energy_j, 0.04, 1e-15);  // kinetic, rounded
  EXPECT_EQ(study.samples.front().energy_j, *study.samples.front().bodies_energy_j);
  EXPECT_GT(BodiesExcess(study), EnergyExcess(study) + 0.05);
}

// A ball turned and moved by hand, a tenth of a radian at a time.
class Rolling : public ::testing::Test {
 protected:
  void Roll(double turn_rad, double way_m, int times) {
    for (int k = 0; k < times; ++k) {
      const Vec3 next = centre_ + way_m * Vec3::UnitX();
      const Mat3 turn = Eigen::AngleAxisd(turn_rad, Vec3::UnitY()).toRotationMatrix();
      for (Vec3& x : state_.position_m) x = next + turn * (x - centre_);
      centre_ = next;
      meter_.Sample(state_);
    }
  }

  const std::shared_ptr<const Model> model_ = ModelOf(
      "bodies:\n  - {name: ball, icosphere: {radius_m: 0.6, subdivisions: 1}, mass_kg: 1}\n");
  const double radius_m_ = std::cbrt(model_->bodies[0].rest_volume_m3 * 3 / (4 * std::numbers::pi));
  State state_ = EngineOf(model_)->state();
  RollingMeter meter_{*model_, model_->bodies[0], state_};
  Vec3 centre_ = Vec3::Zero();
};

TEST_F(Rolling, WithoutSlipTakesTheCentreAsFarAsTheArc) {
  Roll(0.1, 0.1 * radius_m_, 100);
  EXPECT_NEAR(meter_.revolutions(), 10 / (2 * std::numbers::pi), 1e-9);
  EXPECT_NEAR(meter_.travel_m(), 10 * radius_m_, 1e-9);
  EXPECT_NEAR(meter_.slip_m(), 0, 1e-9);  // 100 polar rotations, each to round-off
}

TEST_F(Rolling, SpinningOnTheSpotOrBackwardsIsAllSlip) {
  Roll(0.1, 0, 10);
  EXPECT_NEAR(meter_.slip_m(), radius_m_, 1e-9);
  EXPECT_NEAR(meter_.travel_m(), 0, 1e-12);
  Roll(-0.1, 0.1 * radius_m_, 10);
  EXPECT_NEAR(meter_.slip_m(), radius_m_, 1e-9);
  EXPECT_NEAR(meter_.revolutions(), 0, 1e-9);
}

TEST_F(Rolling, SlidingWithoutTurningIsAllSlip) {
  Roll(0, 0.05, 10);
  EXPECT_NEAR(meter_.slip_m(), 0.5, 1e-9);
  EXPECT_NEAR(meter_.rolled_m(), 0, 1e-9);
}

}  // namespace
}  // namespace adhesim::test
