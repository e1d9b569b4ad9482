#pragma once

#include <gtest/gtest.h>

#include <random>

#include "core/effects/elasticity/elasticity.h"
#include "tests/support/tet_block.h"

namespace adhesim::test {

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
  // By central differences, each component to `tolerance_n`.
  void ExpectForceIsMinusTheGradient(double tolerance_n) {
    Evaluate();
    const std::vector<Vec3> elastic = force[0];
    const double h = 1e-6;
    for (std::size_t p = 0; p < x.size(); ++p) {
      for (int k = 0; k < 3; ++k) {
        x[p](k) += h;
        const double up = Evaluate();
        x[p](k) -= 2 * h;
        const double down = Evaluate();
        x[p](k) += h;
        EXPECT_NEAR(elastic[p](k), -(up - down) / (2 * h), tolerance_n) << p << " " << k;
      }
    }
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

inline Vec3 Sum(const std::vector<Vec3>& f) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& g : f) sum += g;
  return sum;
}
inline double Size(const std::vector<Vec3>& f) {
  double sum = 0;
  for (const Vec3& g : f) sum += g.norm();
  return sum;
}
inline Eigen::VectorXd Flat(const std::vector<Vec3>& f) {
  return Eigen::Map<const Eigen::VectorXd>(f[0].data(), 3 * static_cast<int>(f.size()));
}

inline TetBlock Block(v1::ElasticModel law, double damping_s = 0) {
  return {.cells = {3, 2, 2},
          .size_m = {0.3, 0.2, 0.2},
          .jitter = 0.2,
          .law = law,
          .stiffness_damping_s = damping_s};
}

inline const Mat3 kTurn = Quat(0.2, -0.7, 0.4, 0.5).normalized().toRotationMatrix();

// Tests of both laws.
class ElasticLaw : public testing::TestWithParam<v1::ElasticModel> {};

}  // namespace adhesim::test
