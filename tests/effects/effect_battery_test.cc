#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/contact/detector.h"
#include "core/effects/registry.h"
#include "tests/support/effect_samples.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/tet_block.h"

namespace adhesim::test {
namespace {

// The effects of a sample on a block of 0.5 m that moves and turns.
std::shared_ptr<const Model> BlockOf(const EffectSample& sample) {
  const auto model = ModelOf(TetBlock{.cells = {5, 5, 5}, .size_m = {0.5, 0.5, 0.5}});
  for (int p = 0; p < model->particle_count(); ++p) {
    model->initial_velocity_m_s[p] =
        Vec3(0.1, 0.2, 0.3) + Vec3(0.5, -1, 0.7).cross(model->rest_position_m[p]);
  }
  *model->scene.mutable_effects() =
      WithDefaults(ParseScene(SceneOf(sample), "", "").scene).effects();
  return model;
}

// What every effect has to keep, checked on every effect of the build by itself, as its samples.txt
// says. One without that file fails the battery.
class EffectBattery : public testing::TestWithParam<EffectSample> {
 protected:
  void SetUp() override {
    model_ = GetParam().on == "block" ? BlockOf(GetParam()) : ModelOf(SceneOf(GetParam()));
    auto effect = MakeEffect(*model_, model_->scene.effects(0));
    ASSERT_TRUE(effect.ok()) << effect.status();
    effect_ = *std::move(effect);
    x_ = model_->rest_position_m;
    v_.assign(x_.size(), Vec3::Zero());
    if (GetParam().on == "two_balls") {
      ASSERT_GT(effect_->contact_reach_m(), 0);
      detector_ = std::make_unique<Detector>(*model_, effect_->contact_reach_m());
    }
    state_.resize(effect_->state_size());
    effect_->InitialState(state_);
    for (auto& f : force_) f.assign(x_.size(), Vec3::Zero());
  }
  double Evaluate() {
    for (auto& f : force_) std::fill(f.begin(), f.end(), Vec3::Zero());
    if (detector_) {
      StepReport report;
      detector_->Update(x_, &parallel_, &report);
      near_ = detector_->Find(x_, &parallel_);
    }
    return effect_->AddForces({x_, v_, 0, state_, &parallel_, near_},
                              {force_[0], force_[1], force_[2], force_[3]});
  }
  // Disturbs the particles, and brings the second ball to 0.05 m from the first.
  void Deform(double amount) {
    for (Vec3& x : x_) x += amount * Random();
    if (!GetParam().contact()) return;
    const Body& other = model_->bodies[1];
    for (int k = 0; k < other.particle_count; ++k) x_[other.first_particle + k].x() -= 0.2;
  }
  Vec3 Random() { return {uniform_(random_), uniform_(random_), uniform_(random_)}; }
  static Vec3 Sum(const std::vector<Vec3>& f) {
    Vec3 sum = Vec3::Zero();
    for (const Vec3& g : f) sum += g;
    return sum;
  }
  Vec3 Moment(const std::vector<Vec3>& f) const {
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < f.size(); ++i) sum += x_[i].cross(f[i]);
    return sum;
  }
  static double Size(const std::vector<Vec3>& f) {
    double sum = 0;
    for (const Vec3& g : f) sum += g.norm();
    return sum;
  }

  std::shared_ptr<const Model> model_;
  std::unique_ptr<Effect> effect_;
  std::vector<Vec3> x_, v_;
  std::vector<double> state_;
  std::array<std::vector<Vec3>, kForceKinds> force_;
  std::unique_ptr<Detector> detector_;  // null: the effect is not one of contact
  std::span<const NearPair> near_;      // of the last evaluation
  Parallel parallel_{1};
  std::mt19937 random_{11};
  std::uniform_real_distribution<double> uniform_{-1, 1};
};

TEST_P(EffectBattery, InternalForcesVanishAtRestAndUnderRigidMotion) {
  if (!(effect_->force_kinds() & kElastic)) GTEST_SKIP() << "no elastic force";
  EXPECT_LT(std::abs(Evaluate()), 1e-25);
  EXPECT_LT(Size(force_[0]), 1e-12);  // 162 particles of 50 N/m with positions good to 1e-16 m
  const Mat3 turn = Quat(0.2, -0.7, 0.4, 0.5).normalized().toRotationMatrix();
  for (std::size_t i = 0; i < x_.size(); ++i) {
    x_[i] = turn * x_[i] + Vec3(3, -2, 1);
    v_[i] = Vec3(1, 2, 3).cross(x_[i]) + Vec3(0.5, 0, 0);
  }
  EXPECT_LT(std::abs(Evaluate()), 1e-25);
  // 162 particles at 4 m and 15 m/s: positions and velocities good to 1e-15.
  EXPECT_LT(Size(force_[0]), 1e-10);
  EXPECT_LT(Size(force_[1]), 1e-10);
}

TEST_P(EffectBattery, ElasticForceIsMinusTheGradientOfItsEnergy) {
  if (!(effect_->force_kinds() & kElastic)) GTEST_SKIP() << "no elastic force";
  Deform(0.02);
  Evaluate();
  const std::vector<Vec3> force = force_[0];
  const double h = 1e-6;
  std::vector<int> particles = {0, 17, 80, 161};
  for (const NearPair& pair : near_) {
    particles.insert(particles.end(), {pair.particle, model_->triangles[pair.triangle][0]});
  }
  for (int p : particles) {
    for (int k = 0; k < 3; ++k) {
      x_[p](k) += h;
      const double up = Evaluate();
      x_[p](k) -= 2 * h;
      const double down = Evaluate();
      x_[p](k) += h;
      // Central differences: error h^2 E''' / 6 plus 1e-16 E / h, of the order 1e-9.
      EXPECT_NEAR(force[p](k), -(up - down) / (2 * h), 1e-7) << p << " " << k;
    }
  }
}

TEST_P(EffectBattery, InternalForcesSumToNothing) {
  Deform(0.05);
  for (Vec3& v : v_) v = Random();
  Evaluate();
  for (int kind : {0, 1}) {
    EXPECT_LT(Sum(force_[kind]).norm(), 1e-13 * (1 + Size(force_[kind])));
    EXPECT_LT(Moment(force_[kind]).norm(), 1e-13 * (1 + Size(force_[kind])));
  }
}

TEST_P(EffectBattery, ParticlesShareTheElasticEnergy) {
  Deform(0.05);
  const double energy = Evaluate();
  std::vector<double> share(x_.size(), 0);
  effect_->AddEnergies(share);
  double sum = 0;
  for (double e : share) {
    if (!GetParam().contact()) {
      EXPECT_GE(e, 0);  // that of an attraction may be negative
    }
    sum += e;
  }
  EXPECT_NEAR(sum, energy, 1e-13 * std::abs(energy));  // the same 162 numbers in another order
}

TEST_P(EffectBattery, FrictionTakesEnergy) {
  Deform(0.05);
  for (Vec3& v : v_) v = Random();
  Evaluate();
  for (int kind : {1, 3}) {
    double power = 0;
    for (std::size_t i = 0; i < v_.size(); ++i) power += v_[i].dot(force_[kind][i]);
    EXPECT_LE(power, 0) << "kind " << kind;
    if (effect_->force_kinds() & (1u << kind)) {
      EXPECT_LT(power, -1e-3);
    }
  }
}

TEST_P(EffectBattery, OnlyDeclaredKindsAreWritten) {
  Deform(0.05);
  for (Vec3& v : v_) v = Random();
  Evaluate();
  for (int kind = 0; kind < kForceKinds; ++kind) {
    EXPECT_EQ(Size(force_[kind]) > 0, (effect_->force_kinds() & (1u << kind)) != 0)
        << "kind " << kind;
  }
}

TEST_P(EffectBattery, ForcesFollowARotationOfTheDeformedBody) {
  if (!(effect_->force_kinds() & (kElastic | kDamping))) GTEST_SKIP() << "not internal";
  Deform(0.05);
  for (Vec3& v : v_) v = Random();
  const double energy = Evaluate();
  const auto force = force_;
  const Mat3 turn = Quat(0.3, 0.1, -0.9, 0.2).normalized().toRotationMatrix();
  for (std::size_t i = 0; i < x_.size(); ++i) {
    x_[i] = turn * x_[i] + Vec3(-1, 4, 2);
    v_[i] = turn * v_[i] + Vec3(0.3, 0, 1);
  }
  EXPECT_NEAR(Evaluate(), energy, 1e-12 * (1 + energy));
  for (int kind : {0, 1}) {
    for (std::size_t i = 0; i < x_.size(); ++i) {
      EXPECT_LT((force_[kind][i] - turn * force[kind][i]).norm(), 1e-11 * (1 + Size(force[kind])));
    }
  }
}

TEST_P(EffectBattery, ThreadsDoNotChangeABit) {
  Deform(0.05);
  for (Vec3& v : v_) v = Random();
  const std::vector<double> start = state_;
  const double energy = Evaluate();
  const auto force = force_;
  Parallel two(2);
  for (int kind = 0; kind < kForceKinds; ++kind)
    std::fill(force_[kind].begin(), force_[kind].end(), Vec3::Zero());
  state_ = start;
  EXPECT_EQ(effect_->AddForces({x_, v_, 0, state_, &two, near_},
                               {force_[0], force_[1], force_[2], force_[3]}),
            energy);
  for (int kind = 0; kind < kForceKinds; ++kind) EXPECT_EQ(force_[kind], force[kind]);
}

TEST_P(EffectBattery, ConstraintGradientIsTheDerivativeOfItsResidual) {
  if (effect_->constraints().empty()) GTEST_SKIP() << "no constraint";
  Deform(0.05);
  std::vector<double> up(effect_->constraints().size()), down = up;
  std::vector<Vec3> gradient(x_.size(), Vec3::Zero());
  effect_->ConstraintGradients(x_, {}, gradient);
  EXPECT_LT(Sum(gradient).norm(), 1e-13);
  EXPECT_LT(Moment(gradient).norm(), 1e-13);
  const double h = 1e-5;
  for (int p : {0, 42, 100}) {
    for (int k = 0; k < 3; ++k) {
      x_[p](k) += h;
      effect_->ConstraintResiduals(x_, {}, up);
      x_[p](k) -= 2 * h;
      effect_->ConstraintResiduals(x_, {}, down);
      x_[p](k) += h;
      EXPECT_NEAR(gradient[p](k), (up[0] - down[0]) / (2 * h),
                  1e-10);  // the volume is cubic: error h^2
    }
  }
}

// A bond that has just taken hold is as strong as the adhesive says, and no factor is negative.
TEST_P(EffectBattery, StrengthsAreScaledByFactorsThatBeginAtOne) {
  if (!effect_->scales_strengths()) GTEST_SKIP() << "does not scale strengths";
  const double now_s = 1e3;
  std::vector<Bond> bonds(200);
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    bonds[b].since_s = now_s - std::pow(10, 0.05 * static_cast<double>(b) - 7);  // to 1e3 s
  }
  bonds[0].since_s = now_s;
  bonds[1].sliding = true;
  effect_->ScaleStrengths(now_s, bonds);
  for (const Bond& bond : bonds) {
    EXPECT_TRUE(std::isfinite(bond.strength_scale) && bond.strength_scale >= 0);
  }
  EXPECT_EQ(bonds[0].strength_scale, 1);
  EXPECT_EQ(bonds[1].strength_scale, 1);
  std::vector<Bond> doubled(bonds.size());
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    doubled[b].since_s = bonds[b].since_s;
    doubled[b].sliding = bonds[b].sliding;
    doubled[b].strength_scale = 2;  // another effect has been there
  }
  effect_->ScaleStrengths(now_s, doubled);
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    EXPECT_EQ(doubled[b].strength_scale,
              2 * bonds[b].strength_scale);  // a power of two: no rounding
  }
}

TEST_P(EffectBattery, RestoredSnapshotContinuesWithTheSameBits) {
  auto engine = EngineOf(model_);
  StepMany(engine.get(), 20);
  const State snapshot = engine->state();
  StepMany(engine.get(), 30);
  const std::uint64_t hash = engine->StateHash();
  StepMany(engine.get(), 10);
  engine->Restore(snapshot);
  StepMany(engine.get(), 30);
  EXPECT_EQ(engine->StateHash(), hash);
  engine->Reset();
  EXPECT_EQ(engine->state().step, 0u);
  StepMany(engine.get(), 50);
  EXPECT_EQ(engine->StateHash(), hash);
}

// Those of the samples whose effect is in this build.
std::vector<EffectSample> AvailableSamples() {
  std::vector<EffectSample> samples;
  for (const EffectSample& sample : EffectSamples()) {
    for (std::string_view name : AvailableEffects()) {
      if (name == sample.name()) samples.push_back(sample);
    }
  }
  return samples;
}

INSTANTIATE_TEST_SUITE_P(Effects, EffectBattery, testing::ValuesIn(AvailableSamples()),
                         [](const auto& info) {
                           return std::string(info.param.folder) + "_" + std::to_string(info.index);
                         });

}  // namespace
}  // namespace adhesim::test
