#include "core/effects/elasticity/elasticity.h"

#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "core/model/tissue.h"
#include "tests/support/count_allocations.h"
#include "tests/support/tet_block.h"

namespace adhesim::test {
namespace {

// A block with its effect, and the positions and velocities at which it is evaluated.
struct Tissue {
  explicit Tissue(std::shared_ptr<Model> made)
      : model(std::move(made)), effect(*model, model->scene.effects(0).elasticity()) {
    x = model->rest_position_m;
    v.assign(x.size(), Vec3::Zero());
    state.resize(effect.state_size());
    effect.InitialState(state);
    for (auto& f : force) f.assign(x.size(), Vec3::Zero());
  }
  explicit Tissue(const TetBlock& block) : Tissue(ModelOf(block)) {}

  ForceInput Input(Parallel* parallel) { return {x, v, 0, state, parallel, {}}; }
  double Evaluate() {
    for (auto& f : force) std::fill(f.begin(), f.end(), Vec3::Zero());
    return effect.AddForces(Input(&one), {force[0], force[1], force[2], force[3]});
  }
  BlockMatrix Matrix() {
    BlockMatrix::Pattern pattern;
    effect.AddPairs(&pattern);
    BlockMatrix matrix(model->particle_count(), std::move(pattern));
    effect.UseMatrix(matrix);
    return matrix;
  }
  // scale_k K + scale_d D, dense.
  Eigen::MatrixXd Stiffness(double scale_k, double scale_d) {
    BlockMatrix matrix = Matrix();
    effect.AddStiffness(Input(&one), scale_k, scale_d, &matrix);
    const int n = model->particle_count();
    Eigen::MatrixXd dense(3 * n, 3 * n);
    std::vector<Vec3> unit(n, Vec3::Zero()), column(n);
    for (int c = 0; c < 3 * n; ++c) {
      unit[c / 3](c % 3) = 1;
      matrix.Multiply(unit, column);
      unit[c / 3](c % 3) = 0;
      for (int r = 0; r < n; ++r) dense.block<3, 1>(3 * r, c) = column[r];
    }
    return dense;
  }
  void Strew(double amount, std::vector<Vec3>* what) {
    std::uniform_real_distribution<double> uniform(-amount, amount);
    for (Vec3& at : *what) at += Vec3(uniform(random), uniform(random), uniform(random));
  }
  void Map(const Mat3& f, const Vec3& shift = Vec3::Zero()) {
    for (Vec3& at : x) at = f * at + shift;
  }

  std::shared_ptr<Model> model;
  ElasticityEffect effect;
  std::vector<Vec3> x, v;
  std::vector<double> state;
  std::array<std::vector<Vec3>, kForceKinds> force;
  Parallel one{1};
  std::mt19937 random{5};
};

Vec3 Sum(const std::vector<Vec3>& f) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& g : f) sum += g;
  return sum;
}
double Size(const std::vector<Vec3>& f) {
  double sum = 0;
  for (const Vec3& g : f) sum += g.norm();
  return sum;
}
Eigen::VectorXd Flat(const std::vector<Vec3>& f) {
  return Eigen::Map<const Eigen::VectorXd>(f[0].data(), 3 * static_cast<int>(f.size()));
}

TetBlock Block(v1::ElasticModel law, double damping_s = 0) {
  return {.cells = {3, 2, 2},
          .size_m = {0.3, 0.2, 0.2},
          .jitter = 0.2,
          .law = law,
          .stiffness_damping_s = damping_s};
}

class ElasticLaw : public testing::TestWithParam<v1::ElasticModel> {};
INSTANTIATE_TEST_SUITE_P(Elasticity, ElasticLaw,
                         testing::Values(v1::ELASTIC_MODEL_COROTATIONAL,
                                         v1::ELASTIC_MODEL_NEO_HOOKEAN),
                         [](const auto& info) {
                           return info.param == v1::ELASTIC_MODEL_NEO_HOOKEAN ? "neo_hookean"
                                                                              : "corotational";
                         });
const Mat3 kTurn = Quat(0.2, -0.7, 0.4, 0.5).normalized().toRotationMatrix();

TEST_P(ElasticLaw, NothingAtRestHoweverTurned) {
  Tissue tissue(Block(GetParam()));
  EXPECT_LT(tissue.Evaluate(), 1e-25);
  tissue.Map(kTurn, Vec3(3, -2, 1));
  const double energy = tissue.Evaluate();
  EXPECT_GE(energy, 0);
  // Strain of round-off at 4 m over 0.1 m, 1e-14, and 1 kPa over areas of 0.01 m^2 at 36 particles.
  EXPECT_LT(energy, 1e-25);
  EXPECT_LT(Size(tissue.force[0]), 1e-11);
}

TEST_P(ElasticLaw, ForceIsMinusTheGradientOfTheEnergy) {
  Tissue tissue(Block(GetParam()));
  tissue.Strew(0.02, &tissue.x);
  EXPECT_GT(tissue.Evaluate(), 0);
  const std::vector<Vec3> force = tissue.force[0];
  const double h = 1e-6;
  for (std::size_t p = 0; p < tissue.x.size(); ++p) {
    for (int k = 0; k < 3; ++k) {
      tissue.x[p](k) += h;
      const double up = tissue.Evaluate();
      tissue.x[p](k) -= 2 * h;
      const double down = tissue.Evaluate();
      tissue.x[p](k) += h;
      // Central differences: round-off 1e-16 * 1 J / 1e-6 m, and h^2 E''' / 6 with E''' = 1 kPa.
      EXPECT_NEAR(force[p](k), -(up - down) / (2 * h), 1e-8) << p << " " << k;
    }
  }
}

TEST_P(ElasticLaw, ForcesFollowARotation) {
  Tissue tissue(Block(GetParam(), 0.01));
  tissue.Strew(0.02, &tissue.x);
  tissue.Strew(1, &tissue.v);
  const double energy = tissue.Evaluate();
  const auto force = tissue.force;
  tissue.Map(kTurn, Vec3(0.3, -0.2, 0.1));
  for (Vec3& v : tissue.v) v = kTurn * v + Vec3(1, 2, 3);
  EXPECT_NEAR(tissue.Evaluate(), energy, 1e-10 * energy);
  for (int kind : {0, 1}) {
    for (std::size_t p = 0; p < tissue.x.size(); ++p) {
      EXPECT_LT((tissue.force[kind][p] - kTurn * force[kind][p]).norm(), 1e-10 * Size(force[kind]));
    }
  }
}

TEST_P(ElasticLaw, ForcesAndTorquesSumToNothing) {
  Tissue tissue(Block(GetParam(), 0.01));
  tissue.Strew(0.03, &tissue.x);
  tissue.Strew(1, &tissue.v);
  tissue.Evaluate();
  for (int kind : {0, 1}) {
    const std::vector<Vec3>& f = tissue.force[kind];
    Vec3 torque = Vec3::Zero();
    for (std::size_t p = 0; p < f.size(); ++p) torque += tissue.x[p].cross(f[p]);
    EXPECT_LT(Sum(f).norm(), 1e-12 * Size(f));
    EXPECT_LT(torque.norm(), 1e-12 * Size(f) * 0.4);  // arms of at most 0.4 m
  }
}

// Relative asymmetry, smallest eigenvalue over the largest, and largest sum of a row's blocks.
void ExpectSymmetricPositive(const Eigen::MatrixXd& k) {
  const double size = k.cwiseAbs().maxCoeff();
  EXPECT_LT((k - k.transpose()).cwiseAbs().maxCoeff(), 1e-13 * size);
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(k, Eigen::EigenvaluesOnly).eigenvalues();
  EXPECT_GT(eigenvalues.minCoeff(), -1e-13 * eigenvalues.maxCoeff());
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(k.rows(), 3);
  for (int c = 0; c < k.cols(); ++c) sums.col(c % 3) += k.col(c);
  EXPECT_LT(sums.cwiseAbs().maxCoeff(), 1e-13 * size);
}

TEST_P(ElasticLaw, StiffnessIsSymmetricPositiveWithRowsThatSumToNothing) {
  Tissue tissue(Block(GetParam(), 0.01));
  for (const double amount : {0.0, 0.02, 0.2}) {  // the last one turns tetrahedra inside out
    tissue.Strew(amount, &tissue.x);
    tissue.Evaluate();
    ExpectSymmetricPositive(tissue.Stiffness(1, 0));
    ExpectSymmetricPositive(tissue.Stiffness(0, 1));
  }
}

// Derivative of force `kind` by `what` along `direction`, by central differences.
Eigen::VectorXd Derivative(Tissue* tissue, int kind, std::vector<Vec3>* what,
                           const std::vector<Vec3>& direction, double h) {
  const std::vector<Vec3> at = *what;
  const auto shifted = [&](double by) {
    for (std::size_t p = 0; p < at.size(); ++p) (*what)[p] = at[p] + by * direction[p];
    tissue->Evaluate();
    return Flat(tissue->force[kind]);
  };
  const Eigen::VectorXd up = shifted(h), down = shifted(-h);
  *what = at;
  tissue->Evaluate();
  return (up - down) / (2 * h);
}

TEST_P(ElasticLaw, StiffnessIsTheDerivativeOfTheForceAtRestHoweverTurned) {
  Tissue tissue(Block(GetParam()));
  tissue.Map(kTurn);
  tissue.Evaluate();
  const Eigen::MatrixXd k = tissue.Stiffness(1, 0);
  std::vector<Vec3> d(tissue.x.size(), Vec3::Zero());
  tissue.Strew(1, &d);
  const Eigen::VectorXd derivative = Derivative(&tissue, 0, &tissue.x, d, 1e-6);
  // Differences err by h^2 and by round-off 1e-15 / h, relative.
  EXPECT_LT((k * Flat(d) + derivative).norm(), 1e-8 * derivative.norm());
}

TEST(Corotational, StiffnessErrsByNoMoreThanTheStrainWhenDeformed) {
  Tissue tissue(Block(v1::ELASTIC_MODEL_COROTATIONAL));
  const double strain = 0.01;
  tissue.Map(kTurn * Vec3(1 + strain, 1 - strain / 2, 1).asDiagonal());
  tissue.Evaluate();
  const Eigen::MatrixXd k = tissue.Stiffness(1, 0);
  std::vector<Vec3> d(tissue.x.size(), Vec3::Zero());
  tissue.Strew(1, &d);
  const Eigen::VectorXd derivative = Derivative(&tissue, 0, &tissue.x, d, 1e-6);
  // What is left out is the stress times the turning: of the order of the strain, 1 %.
  EXPECT_LT((k * Flat(d) + derivative).norm(), 2 * strain * derivative.norm());
}

TEST_P(ElasticLaw, DampingMatrixIsTheDerivativeOfTheDampingForce) {
  Tissue tissue(Block(GetParam(), 0.01));
  tissue.Strew(0.02, &tissue.x);
  tissue.Strew(1, &tissue.v);
  tissue.Evaluate();
  const Eigen::MatrixXd d = tissue.Stiffness(0, 1);
  // Damping is linear in velocity: differences of any size are exact but for round-off.
  EXPECT_LT((d * Flat(tissue.v) + Flat(tissue.force[1])).norm(), 1e-13 * Size(tissue.force[1]));
  EXPECT_LT(Flat(tissue.v).dot(Flat(tissue.force[1])), 0);
}

TEST_P(ElasticLaw, DampingAtRestIsRayleighs) {
  Tissue tissue(Block(GetParam(), 0.01));
  const Eigen::MatrixXd k = tissue.Stiffness(1, 0), d = tissue.Stiffness(0, 1);
  EXPECT_LT((d - 0.01 * k).norm(), 1e-14 * k.norm());  // the same sums, with F for R
}

TEST_P(ElasticLaw, BoundIsAboveTheLargestFrequencyAndNotFarFromIt) {
  for (const double poisson : {0.0, 0.3, 0.45}) {
    TetBlock block = Block(GetParam());
    block.poisson_ratio = poisson;
    Tissue tissue(block);
    std::vector<double> stiffness(tissue.x.size(), 0), damping(stiffness);
    tissue.effect.AddBounds(stiffness, damping);
    double bound = 0;
    Eigen::MatrixXd scaled = tissue.Stiffness(1, 0);
    for (std::size_t p = 0; p < stiffness.size(); ++p) {
      bound = std::max(bound, stiffness[p] / tissue.model->mass_kg[p]);
      const double root = 1 / std::sqrt(tissue.model->mass_kg[p]);
      scaled.middleRows<3>(3 * p) *= root;
      scaled.middleCols<3>(3 * p) *= root;
    }
    const double largest =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled, Eigen::EigenvaluesOnly)
            .eigenvalues()
            .maxCoeff();
    EXPECT_GE(bound, largest) << poisson;
    EXPECT_LE(bound, 3 * largest) << poisson;  // what Gershgorin's circles lose
  }
}

TEST_P(ElasticLaw, ThreadsAndInstructionSetsDoNotChangeABit) {
  TetBlock block = Block(GetParam(), 0.01);
  block.cells = {16, 9, 9};  // enough to be split among threads
  Tissue tissue(block);
  tissue.Strew(0.02, &tissue.x);
  tissue.Strew(1, &tissue.v);
  const std::vector<double> start = tissue.state;
  BlockMatrix matrix = tissue.Matrix();
  double energy = 0;
  std::vector<double> state;
  std::vector<Vec3> elastic, damping, product(tissue.x.size()), first_product;
  for (const Simd simd : AvailableSimd()) {
    for (const int threads : {1, 2, 3, 4}) {
      Parallel parallel(threads, simd);
      tissue.state = start;
      for (auto& f : tissue.force) std::fill(f.begin(), f.end(), Vec3::Zero());
      const double e = tissue.effect.AddForces(tissue.Input(&parallel),
                                               {tissue.force[0], tissue.force[1], {}, {}});
      matrix.SetZero();
      tissue.effect.AddStiffness(tissue.Input(&parallel), 0.3, 0.7, &matrix);
      matrix.Multiply(tissue.v, product);
      if (elastic.empty()) {
        energy = e;
        state = tissue.state;
        elastic = tissue.force[0];
        damping = tissue.force[1];
        first_product = product;
      }
      const auto where = testing::Message() << SimdName(simd) << ", " << threads << " threads";
      EXPECT_EQ(e, energy) << where;
      EXPECT_EQ(tissue.state, state) << where;
      EXPECT_EQ(tissue.force[0], elastic) << where;
      EXPECT_EQ(tissue.force[1], damping) << where;
      EXPECT_EQ(product, first_product) << where;
    }
  }
}

TEST_P(ElasticLaw, AllocatesNothing) {
  Tissue tissue(Block(GetParam(), 0.01));
  BlockMatrix matrix = tissue.Matrix();
  tissue.Strew(0.2, &tissue.x);
  Parallel two(2);
  std::vector<double> share(tissue.x.size(), 0);
  const long before = allocations;
  for (Parallel* parallel : {&tissue.one, &two}) {
    tissue.effect.AddForces(tissue.Input(parallel), {tissue.force[0], tissue.force[1], {}, {}});
    tissue.effect.AddStiffness(tissue.Input(parallel), 1, 1, &matrix);
    tissue.effect.AddEnergies(share);
  }
  EXPECT_EQ(allocations, before);
}

TEST_P(ElasticLaw, ForceIsMinusTheGradientWhenCrushedAndInverted) {
  Tissue tissue(Block(GetParam()));
  tissue.Strew(0.1, &tissue.x);  // as wide as a cell
  tissue.Evaluate();
  const std::vector<Vec3> force = tissue.force[0];
  const double h = 1e-7;
  for (std::size_t p = 0; p < tissue.x.size(); ++p) {
    for (int k = 0; k < 3; ++k) {
      tissue.x[p](k) += h;
      const double up = tissue.Evaluate();
      tissue.x[p](k) -= 2 * h;
      const double down = tissue.Evaluate();
      tissue.x[p](k) += h;
      // Strains of 1 and more: energies of 10 J err by 1e-15 J, over 1e-7 m.
      EXPECT_NEAR(force[p](k), -(up - down) / (2 * h), 1e-7 * Size(force)) << p << " " << k;
    }
  }
}

TEST(NeoHookean, StiffnessIsTheDerivativeOfTheForceWhereNothingIsProjected) {
  Tissue tissue(Block(v1::ELASTIC_MODEL_NEO_HOOKEAN));
  tissue.Map(1.1 * kTurn);  // stretched, so that no eigenvalue is near zero
  tissue.Strew(0.001, &tissue.x);
  tissue.Evaluate();
  const Eigen::MatrixXd k = tissue.Stiffness(1, 0);
  std::vector<Vec3> d(tissue.x.size(), Vec3::Zero());
  tissue.Strew(1, &d);
  const Eigen::VectorXd derivative = Derivative(&tissue, 0, &tissue.x, d, 1e-6);
  // Differences as above; the frame of the singular values is good to 1e-8 where two of them agree.
  EXPECT_LT((k * Flat(d) + derivative).norm(), 1e-7 * derivative.norm());
}

// A tetrahedron stretched by s_0, s_1, s_2 along x, y, z; tr P / V of its corners' forces.
Mat3 StressOf(v1::ElasticModel law, double poisson, const Vec3& stretch) {
  Tissue tissue(TetBlock{.cells = {1, 1, 1}, .poisson_ratio = poisson, .law = law});
  tissue.Map(stretch.asDiagonal());
  tissue.Evaluate();
  Mat3 stress = Mat3::Zero();  // P V = -sum f_a X_a^T, and V = 1
  for (std::size_t p = 0; p < tissue.x.size(); ++p) {
    stress -= tissue.force[0][p] * tissue.model->rest_position_m[p].transpose();
  }
  return stress;
}

TEST(NeoHookean, UniaxialStressIsTheClosedForm) {
  // With free sides mu b + (lambda ln(a b^2) - mu) / b = 0 for the lateral stretch b; then P_11 =
  // mu a + (lambda ln(a b^2) - mu) / a. In the incompressible limit mu (a - 1 / a^2).
  for (const double poisson : {0.0, 0.3, 0.45, 0.499}) {
    const double mu = 1000 / (2 * (1 + poisson)), lambda = 2 * mu * poisson / (1 - 2 * poisson);
    for (const double a : {0.5, 0.9, 1.0, 1.5, 3.0}) {
      double low = 0.1, high = 3;  // the equation rises with b
      for (int k = 0; k < 100; ++k) {
        const double b = 0.5 * (low + high);
        (mu * b * b + lambda * std::log(a * b * b) - mu > 0 ? high : low) = b;
      }
      const Mat3 stress = StressOf(v1::ELASTIC_MODEL_NEO_HOOKEAN, poisson, {a, low, low});
      const double expected = mu * a + (lambda * std::log(a * low * low) - mu) / a;
      // Round-off of lambda, up to 250 mu.
      EXPECT_NEAR(stress(0, 0), expected, 1e-10 * (mu + lambda)) << poisson << " " << a;
      EXPECT_LT((stress - Mat3(Vec3(stress(0, 0), 0, 0).asDiagonal())).norm(),
                1e-10 * (mu + lambda));
      if (poisson == 0.499) {  // compressible by 1 / 500
        EXPECT_NEAR(expected, mu * (a - 1 / (a * a)), 0.01 * mu * (1 + a)) << a;
      }
    }
  }
}

TEST(NeoHookean, IsSmoothWhereItsContinuationBegins) {
  // P_11 of a uniform compression about J = 0.2, where the continuation has the same value, slope
  // and curvature of energy: the stress has no jump, and neither has its slope.
  const auto stress = [](double j) {
    const double s = std::cbrt(j);
    return StressOf(v1::ELASTIC_MODEL_NEO_HOOKEAN, 0.3, {s, s, s})(0, 0);
  };
  const double h = 1e-5, at = stress(0.2), scale = std::abs(at);
  const double below = (at - stress(0.2 - h)) / h, above = (stress(0.2 + h) - at) / h;
  EXPECT_NEAR(stress(0.2 - 1e-9), stress(0.2 + 1e-9), 1e-6 * scale);  // slope 5 / J times 2e-9
  EXPECT_NEAR(below, above, 1e-3 * std::abs(above));                  // second derivative times h
}

TEST(Corotational, SmallUniaxialStressIsYoungsModulusTimesStrain) {
  const double strain = 1e-3;
  for (const double poisson : {0.0, 0.3, 0.45}) {
    const Mat3 stress = StressOf(v1::ELASTIC_MODEL_COROTATIONAL, poisson,
                                 {1 + strain, 1 - poisson * strain, 1 - poisson * strain});
    // Linear in the stretches: only round-off.
    EXPECT_NEAR(stress(0, 0), 1000 * strain, 1e-10);
    EXPECT_LT((stress - Mat3(Vec3(stress(0, 0), 0, 0).asDiagonal())).norm(), 1e-10);
  }
}

TEST_P(ElasticLaw, PatchTestAnAffineBoundaryGivesAnAffineInside) {
  // A distorted mesh whose outer particles are moved by x -> A x + b: equilibrium of the inner
  // ones, found by Newton's method, is at A X + b.
  for (const bool six : {false, true}) {
    TetBlock block{.cells = {4, 3, 3}, .six_a_cell = six, .jitter = 0.25, .poisson_ratio = 0.4};
    block.law = GetParam();
    Tissue tissue(block);
    Mat3 affine = Mat3::Identity();
    affine += (Mat3() << 0.05, 0.02, -0.03, 0.01, -0.04, 0.02, 0.03, -0.01, 0.02).finished();
    std::vector<int> inner;
    for (int p = 0; p < tissue.model->particle_count(); ++p) {
      const Vec3& at = tissue.model->rest_position_m[p];
      if (at.minCoeff() > 1e-9 && at.maxCoeff() < 1 - 1e-9) inner.push_back(p);
    }
    ASSERT_EQ(inner.size(), 12u);
    tissue.Map(kTurn * affine, Vec3(0.1, 0.2, 0.3));
    const std::vector<Vec3> expected = tissue.x;
    tissue.Evaluate();
    double worst = 0;
    for (int p : inner) worst = std::max(worst, tissue.force[0][p].norm());
    EXPECT_LT(worst, 1e-12 * Size(tissue.force[0]));  // affine: in equilibrium
    for (int p : inner) tissue.x[p] += Vec3(0.02, -0.01, 0.01);
    const int n = 3 * static_cast<int>(inner.size());
    for (int iteration = 0; iteration < 200; ++iteration) {
      tissue.Evaluate();
      const Eigen::MatrixXd k = tissue.Stiffness(1, 0);
      Eigen::MatrixXd reduced(n, n);
      Eigen::VectorXd residual(n);
      for (int i = 0; i < n / 3; ++i) {
        residual.segment<3>(3 * i) = tissue.force[0][inner[i]];
        for (int j = 0; j < n / 3; ++j) {
          reduced.block<3, 3>(3 * i, 3 * j) = k.block<3, 3>(3 * inner[i], 3 * inner[j]);
        }
      }
      const Eigen::VectorXd step = reduced.ldlt().solve(residual);
      for (int i = 0; i < n / 3; ++i) tissue.x[inner[i]] += step.segment<3>(3 * i);
      if (step.norm() < 1e-14) break;  // the corotational stiffness is inexact: some ten steps
    }
    for (int p : inner) EXPECT_LT((tissue.x[p] - expected[p]).norm(), 1e-10) << p;
  }
}

// A bar of 4 x 1 x 1 cells of 1 kPa, with regions given as text.
std::shared_ptr<Model> BarWith(const std::string& regions) {
  const auto model = ModelOf(TetBlock{.cells = {4, 1, 1}, .size_m = {0.4, 0.1, 0.1}});
  v1::Elasticity* elasticity = model->scene.mutable_effects(0)->mutable_elasticity();
  EXPECT_TRUE(google::protobuf::TextFormat::MergeFromString(regions, elasticity));
  return model;
}

TEST(MaterialRegions, SelectByShapeLabelAndGroupAndTheLastOneCounts) {
  const auto model = BarWith(
      "regions {where {half_space {point_m: [0.2, 0, 0] normal: [1, 0, 0]}} young_modulus_pa: 2000}"
      "regions {where {ball {centre_m: [0, 0.05, 0.05] radius_m: 0.1}} young_modulus_pa: 3000 "
      "poisson_ratio: 0.4}"
      "regions {where {label: 7} young_modulus_pa: 4000}"
      "regions {where {group: 'vessel'} young_modulus_pa: 5000}");
  model->tet_label[12] = 7;
  model->group_names = {"lobe", "vessel"};
  model->tet_group[15] = 0;
  model->tet_group[16] = 1;
  const v1::Elasticity& elasticity = model->scene.effects(0).elasticity();
  for (int t = 0; t < 20; ++t) {  // five a cell
    const Material material = MaterialOf(elasticity, *model, t);
    const double young = t == 12 ? 4000 : t == 16 ? 5000 : t < 5 ? 3000 : t < 10 ? 2000 : 1000;
    EXPECT_EQ(material.young_modulus_pa, young) << t;
    EXPECT_EQ(material.poisson_ratio, t < 5 ? 0.4 : 0.3) << t;
  }
}

TEST(MaterialRegions, EnergyIsThatOfEachPartsMaterial) {
  const auto model = BarWith(
      "regions {where {half_space {point_m: [0.2, 0, 0] normal: [1, 0, 0]}} "
      "young_modulus_pa: 2000 poisson_ratio: 0.3}");
  model->fill[19] = 0.5;
  Tissue tissue(model);
  tissue.Map(Vec3(1.01, 1, 1).asDiagonal());
  // psi = (mu + lambda/2) strain^2 in proportion to E: half of the bar twice as stiff, and half of
  // the last tetrahedron (a sixth of a cell) empty. Round-off of strain 0.01 is 1e-14 of it.
  const Material soft{1000, 0.3};
  const double density = (soft.mu() + soft.lambda() / 2) * 1e-4, cell = 1e-3;
  EXPECT_NEAR(tissue.Evaluate(), density * cell * (2 * 2 + 2 - 0.5 / 6), 1e-12 * density * cell);
}

}  // namespace
}  // namespace adhesim::test
