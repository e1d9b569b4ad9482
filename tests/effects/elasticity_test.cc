#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "core/model/tissue.h"
#include "tests/effects/tissue_forces.h"
#include "tests/support/count_allocations.h"

namespace adhesim::test {
namespace {

INSTANTIATE_TEST_SUITE_P(Elasticity, ElasticLaw,
                         testing::Values(v1::ELASTIC_MODEL_COROTATIONAL,
                                         v1::ELASTIC_MODEL_NEO_HOOKEAN),
                         [](const auto& info) {
                           return info.param == v1::ELASTIC_MODEL_NEO_HOOKEAN ? "neo_hookean"
                                                                              : "corotational";
                         });

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
  // Central differences: round-off 1e-16 * 1 J / 1e-6 m, and h^2 E''' / 6 with E''' = 1 kPa.
  tissue.ExpectForceIsMinusTheGradient(1e-8);
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

// A block for implicit steps whose stiffness lags behind its rotations (undamped, corotational).
Tissue LaggingTissue() {
  TetBlock block = Block(v1::ELASTIC_MODEL_COROTATIONAL);
  block.cells = {12, 5, 4};  // many batches
  std::shared_ptr<Model> model = ModelOf(block);
  model->integrator = Integrator::kImplicit;
  return Tissue(model);
}

TEST(Corotational, StiffnessTurnsAlongOnceATetrahedronHasTurnedByAMilliradian) {
  Tissue tissue = LaggingTissue();
  tissue.Evaluate();
  const Eigen::MatrixXd rest = tissue.Stiffness(1, 0);
  const auto turned = [&](double angle_rad) {
    tissue.x = tissue.model->rest_position_m;
    tissue.Map(Eigen::AngleAxisd(angle_rad, Vec3(0.6, 0, 0.8)).toRotationMatrix());
    tissue.Evaluate();
    return tissue.Stiffness(1, 0);
  };
  EXPECT_EQ(turned(0.00099), rest);
  // The square of its angle is told to round-off, some 1e-13 of 1e-6.
  const Eigen::MatrixXd after = turned(0.00101);
  const Mat3 turn = Eigen::AngleAxisd(0.00101, Vec3(0.6, 0, 0.8)).toRotationMatrix();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const Mat3 expected = turn * rest.block<3, 3>(3 * i, 3 * j) * turn.transpose();
      EXPECT_LT((after.block<3, 3>(3 * i, 3 * j) - expected).norm(), 1e-11 * rest.norm());
    }
  }
  // Forces never lag: none in a block that is turned as a whole.
  EXPECT_LT(Size(tissue.force[0]), 1e-9);
}

// A matrix that was kept and renewed in places, against one that was made anew of the same state.
TEST(Corotational, WhatIsSummedAnewInPlacesIsTheSumOfAll) {
  Tissue tissue = LaggingTissue();
  BlockMatrix matrix = tissue.Matrix();
  Parallel two(2);
  for (int step = 0; step < 12; ++step) {
    // A ridge that widens along the block, a plane of particles a step: two of twelve slices turn.
    for (std::size_t p = 0; p < tissue.x.size(); ++p) {
      const double from = tissue.model->rest_position_m[p].x() - 0.025 * step;
      tissue.x[p].z() += 0.002 * std::exp(-1e4 * from * from);
    }
    tissue.Evaluate();
    matrix.SetZero();
    const double scale = step < 6 ? 0.3 : 0.2;  // as where a step is cut into more sub-steps
    tissue.effect.AddStiffness(tissue.Input(step % 3 == 0 ? &two : &tissue.one), scale, 0, &matrix);
    Tissue other = LaggingTissue();
    other.state = tissue.state;
    BlockMatrix whole = other.Matrix();
    other.effect.AddStiffness(other.Input(&other.one), scale, 0, &whole);
    for (std::size_t k = 0; k < matrix.column().size(); ++k) {
      ASSERT_EQ(matrix.At(static_cast<int>(k)), whole.At(static_cast<int>(k))) << step;
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
  // What is inside out recovers, and its neighbours with it, a layer each time.
  for (int layer = 0; layer < 4; ++layer) tissue.Evaluate();
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

TEST(NeoHookean, IsPushedOpenWhereItIsNearlyAPoint) {
  Tissue tissue(Block(v1::ELASTIC_MODEL_NEO_HOOKEAN));
  tissue.Map(0.1 * kTurn);
  tissue.Strew(0.001, &tissue.x);
  tissue.Evaluate();
  const std::vector<Vec3> force = tissue.force[0];
  // Tr P, per volume: mu/2 (t_0 - 0.3)^2 of the collapse term beside 0.1 mu of I_C.
  double opening = 0;
  for (std::size_t p = 0; p < tissue.x.size(); ++p) {
    opening += force[p].dot(kTurn * tissue.model->rest_position_m[p]);
  }
  EXPECT_GT(opening, 0);
  // As above; energies of tens of J err by 1e-14 J over 1e-6 m.
  tissue.ExpectForceIsMinusTheGradient(1e-6);
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

}  // namespace
}  // namespace adhesim::test
