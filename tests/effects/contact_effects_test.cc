#include <gtest/gtest.h>

#include "core/effects/registry.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

// One pair of two balls: particle 0 of the first at a chosen place beside triangle 0 of the second.
class OnePair : public testing::Test {
 protected:
  void Make(const std::string& effect) {
    model_ = ModelOf(
        "bodies:\n"
        "  - {name: a, icosphere: {radius_m: 0.5}, mass_kg: 1}\n"
        "  - {name: b, icosphere: {radius_m: 0.5}, mass_kg: 1, position_m: [3, 0, 0]}\n"
        "effects:\n  - " +
        effect + "\n");
    auto made = MakeEffect(*model_, model_->scene.effects(0));
    ASSERT_TRUE(made.ok()) << made.status();
    effect_ = *std::move(made);
    x_ = model_->rest_position_m;
    v_.assign(x_.size(), Vec3::Zero());
    state_.resize(effect_->state_size());
    effect_->InitialState(state_);
    pair_.particle = 0;
    pair_.body = 1;
    pair_.triangle = model_->bodies[1].first_triangle;
    pair_.weights = {0.5, 0.3, 0.2};
    tri_ = model_->triangles[pair_.triangle];
    point_ = 0.5 * x_[tri_[0]] + 0.3 * x_[tri_[1]] + 0.2 * x_[tri_[2]];
    pair_.normal = (x_[tri_[1]] - x_[tri_[0]]).cross(x_[tri_[2]] - x_[tri_[0]]).normalized();
    pair_.side = 1;
  }
  // The energy, and in push_n_ and damping_n_ the forces along the normal on the particle.
  double At(double gap_m) {
    x_[0] = point_ + gap_m * pair_.normal;
    pair_.gap_m = gap_m;
    elastic_.assign(x_.size(), Vec3::Zero());
    damping_.assign(x_.size(), Vec3::Zero());
    const double energy_j = effect_->AddForces(
        {x_, v_, 0, state_, &parallel_, std::span(&pair_, 1)}, {elastic_, damping_, {}, {}});
    push_n_ = elastic_[0].dot(pair_.normal);
    damping_n_ = damping_[0].dot(pair_.normal);
    for (int k = 0; k < 3; ++k) {
      EXPECT_LT((elastic_[tri_[k]] + pair_.weights(k) * elastic_[0]).norm(), 1e-12);
    }
    return energy_j;
  }

  std::shared_ptr<const Model> model_;
  std::unique_ptr<Effect> effect_;
  std::vector<Vec3> x_, v_, elastic_, damping_;
  std::vector<double> state_;
  NearPair pair_;
  Triangle tri_;
  Vec3 point_;
  Parallel parallel_{1};
  double push_n_ = 0, damping_n_ = 0;
};

// Positions of 3 m are good to 4e-16, times 1000 N/m: 1e-12 N is round-off.
constexpr double kRoundOff = 1e-11;

TEST_F(OnePair, PenaltyPushesInProportionToDepthAndNeverPulls) {
  Make("penalty: {thickness_m: 0.01, stiffness_n_m: 1000, damping_n_s_m: 4}");
  EXPECT_EQ(At(0.0101), 0);
  EXPECT_EQ(push_n_, 0);
  EXPECT_NEAR(At(0.004), 0.5 * 1000 * 0.006 * 0.006, kRoundOff);
  EXPECT_NEAR(push_n_, 6, kRoundOff);
  EXPECT_NEAR(At(-0.005), 0.5 * 1000 * 0.015 * 0.015, kRoundOff);
  v_[0] = -2 * pair_.normal;
  At(0.004);
  EXPECT_NEAR(damping_n_, 8, kRoundOff);
  v_[0] = 2 * pair_.normal;  // -8 N would pull
  At(0.004);
  EXPECT_NEAR(push_n_ + damping_n_, 0, kRoundOff);
}

// Clavet et al. 2005: I / dt = -k d (1 - d / s), at most k s / 4, and k s^2 / 6 to come free.
TEST_F(OnePair, ImpulsesAttractByTheirFormula) {
  Make(
      "attraction_impulses: {stick_distance_m: 0.02, stick_stiffness_n_m: 1000, "
      "contact_stiffness_n_m: 3000}");
  EXPECT_EQ(At(0.021), 0);
  EXPECT_EQ(push_n_, 0);
  At(0.01);
  EXPECT_NEAR(push_n_, -1000 * 0.02 / 4, kRoundOff);
  At(0.004);
  EXPECT_NEAR(push_n_, -1000 * 0.004 * 0.8, kRoundOff);
  EXPECT_NEAR(At(0), -1000 * 0.02 * 0.02 / 6, kRoundOff);
  EXPECT_NEAR(At(-0.002) - At(0), 0.5 * 3000 * 0.002 * 0.002, kRoundOff);
  At(-0.002);
  EXPECT_NEAR(push_n_, 6, kRoundOff);
}

TEST_F(OnePair, LinkHoldsWhereItWasMadeUntilItIsTooLong) {
  Make(
      "elastic_links: {capture_distance_m: 0.01, stiffness_n_m: 1000, rest_length_m: 0.004, "
      "max_length_m: 0.03}");
  EXPECT_EQ(At(0.011), 0);
  EXPECT_EQ(state_[0], -1);
  EXPECT_NEAR(At(0.009), 0.5 * 1000 * 0.005 * 0.005, kRoundOff);
  EXPECT_NEAR(push_n_, -5, kRoundOff);
  EXPECT_EQ(state_[0], pair_.triangle);
  pair_.weights = {0.2, 0.3, 0.5};  // slid on: the link stays where it was made
  x_[0] = point_ + 0.02 * pair_.normal;
  EXPECT_NEAR(effect_->AddForces({x_, v_, 0, state_, &parallel_, std::span(&pair_, 1)},
                                 {elastic_, damping_, {}, {}}),
              0.5 * 1000 * 0.016 * 0.016, kRoundOff);
  EXPECT_EQ(At(0.031), 0);
  EXPECT_EQ(state_[0], -1);
}

}  // namespace
}  // namespace adhesim::test
