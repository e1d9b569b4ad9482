#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "core/model/tissue.h"
#include "tests/effects/tissue_forces.h"
#include "tests/support/test_size.h"

// Both laws against closed forms, and the materials of parts.
namespace adhesim::test {
namespace {

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

// One tetrahedron, the first of a block of one cell.
std::shared_ptr<Model> OneTetrahedron(double poisson) {
  const auto model = ModelOf(
      TetBlock{.cells = {1, 1, 1}, .poisson_ratio = poisson, .law = v1::ELASTIC_MODEL_NEO_HOOKEAN});
  model->tetrahedra.resize(1);
  model->fill.resize(1);
  model->tet_label.resize(1);
  model->tet_group.resize(1);
  model->bodies[0].tetrahedron_count = 1;
  return model;
}

TEST(NeoHookean, HasNoMinimumButItsShape) {
  // Descent of one tetrahedron from anywhere, along its own positive stiffness with a mass that
  // keeps steps short: the energy ends at 1e-12 of mu V, a strain of 1e-6, whatever the start.
  std::uniform_real_distribution<double> uniform(-2, 2);
  const int starts = kSanitized ? 20 : TestSize(500, 10000);
  int stuck = 0;
  for (const double poisson : {0.0, 0.45}) {
    Tissue tissue(OneTetrahedron(poisson));
    const std::vector<double> law = tissue.state;
    const int n = 3 * static_cast<int>(tissue.x.size());
    for (int start = 0; start < starts; ++start) {
      for (Vec3& x : tissue.x) {
        x = Vec3(uniform(tissue.random), uniform(tissue.random), uniform(tissue.random));
      }
      tissue.state = law;
      double energy = tissue.Evaluate();
      for (int step = 0; step < 300 && !(energy < 1e-9); ++step) {
        const Eigen::MatrixXd a = tissue.Stiffness(1, 0) + 100 * Eigen::MatrixXd::Identity(n, n);
        const Eigen::VectorXd by = a.ldlt().solve(Flat(tissue.force[0]));
        for (int p = 0; p < n / 3; ++p) tissue.x[p] += by.segment<3>(3 * p);
        energy = tissue.Evaluate();
      }
      stuck += !(energy < 1e-9);
    }
  }
  EXPECT_EQ(stuck, 0) << "of " << 2 * starts;
}

TEST(NeoHookean, RecoversByTheCorotationalLawOnceItIsInsideOut) {
  // Without lambda, which is softened. Mirrored, the force is the corotational one; brought back to
  // a strain of 10 %, it still is; and at 1 % the law is its own again.
  Tissue tissue(OneTetrahedron(0));
  auto other = OneTetrahedron(0);
  other->scene.mutable_effects(0)->mutable_elasticity()->set_model(v1::ELASTIC_MODEL_COROTATIONAL);
  Tissue corotational(other);
  const std::vector<Vec3> rest = tissue.x;
  const auto difference = [&](const Vec3& stretch) {
    tissue.x = corotational.x = rest;
    tissue.Map(stretch.asDiagonal());
    corotational.Map(stretch.asDiagonal());
    tissue.Evaluate();
    corotational.Evaluate();
    double sum = 0;
    for (std::size_t p = 0; p < rest.size(); ++p) {
      sum += (tissue.force[0][p] - corotational.force[0][p]).norm();
    }
    return sum / Size(corotational.force[0]);
  };
  EXPECT_GT(difference({1.1, 1, 1}), 0.01);
  EXPECT_LT(difference({1.1, 1, -1.2}), 1e-12);  // round-off
  EXPECT_LT(difference({1.1, 1, 1}), 1e-12);
  EXPECT_GT(difference({1.01, 1, 1}), 1e-3);
  EXPECT_GT(difference({1.1, 1, 1}), 0.01);
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
