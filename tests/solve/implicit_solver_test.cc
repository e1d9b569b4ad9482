#include "core/solve/implicit_solver.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "core/model/diagnostics.h"
#include "tests/support/spring_world.h"

namespace adhesim {
namespace {

using test::Cloud;
using test::SpringWorld;

// The system's matrix and the subspace's basis written out, solved by Eigen.
Eigen::VectorXd DenseChange(SpringWorld& world, double dt_s) {
  const int n = world.model.particle_count();
  BlockMatrix::Pattern pattern;
  world.springs.AddPairs(&pattern);
  BlockMatrix stiffness(n, std::move(pattern));
  const ForceInput in{
      world.state.position_m, world.state.velocity_m_s, 0, {}, world.parallel.get()};
  world.springs.AddStiffness(in, 1, 0, &stiffness);
  const auto dense = [&](const BlockMatrix& matrix) {
    Eigen::MatrixXd full = Eigen::MatrixXd::Zero(3 * n, 3 * n);
    for (int i = 0; i < n; ++i) {
      for (int k = matrix.row_start()[i]; k < matrix.row_start()[i + 1]; ++k) {
        full.block<3, 3>(3 * i, 3 * matrix.column()[k]) = matrix.At(k);
      }
    }
    return full;
  };
  const Eigen::MatrixXd k = dense(stiffness);
  stiffness.SetZero();
  world.springs.AddStiffness(in, 0, 1, &stiffness);
  const Eigen::MatrixXd d = dense(stiffness);
  Eigen::MatrixXd a = dt_s * d + dt_s * dt_s * k;
  Eigen::VectorXd v(3 * n), f(3 * n);
  std::vector<Vec3> elastic(n, Vec3::Zero()), damping(n, Vec3::Zero());
  world.springs.AddForces(in, {elastic, damping, {}, {}});
  for (int p = 0; p < n; ++p) {
    a.block<3, 3>(3 * p, 3 * p) += world.model.mass_kg[p] * Mat3::Identity();
    v.segment<3>(3 * p) = world.state.velocity_m_s[p];
    f.segment<3>(3 * p) = elastic[p] + damping[p] + world.model.mass_kg[p] * world.gravity_m_s2;
  }
  // Columns: free particles, then the zones' twists.
  std::vector<Eigen::VectorXd> columns;
  Eigen::VectorXd prescribed = Eigen::VectorXd::Zero(3 * n);
  for (int p = 0; p < n; ++p) {
    if (world.model.fixed[p] || world.state.contacts.zone_of[p] >= 0) continue;
    for (int c = 0; c < 3; ++c) columns.push_back(Eigen::VectorXd::Unit(3 * n, 3 * p + c));
  }
  world.subspace->FormGroups(world.state, world.tool_twist);
  for (std::size_t z = 0; z < world.state.contacts.zones.size(); ++z) {
    const Zone& zone = world.state.contacts.zones[z];
    const RigidGroup& group = world.subspace->groups()[z];
    const auto members =
        std::span(world.state.contacts.zone_members).subspan(zone.first, zone.count);
    const auto spread = [&](const Twist& twist) {
      Eigen::VectorXd column = Eigen::VectorXd::Zero(3 * n);
      for (int p : members) {
        if (world.model.fixed[p]) continue;
        column.segment<3>(3 * p) =
            twist.linear_m_s + twist.angular_rad_s.cross(world.state.position_m[p] - group.pivot_m);
      }
      return column;
    };
    if (group.driven()) {
      prescribed += spread(group.twist);
      for (int p : members) prescribed.segment<3>(3 * p) -= v.segment<3>(3 * p);
      continue;
    }
    // Of the six twists those that the group's own response to a wrench can make.
    for (int c = 0; c < 6; ++c) {
      const Vec6 unit = Vec6::Unit(c);
      const Eigen::VectorXd column = spread(group.Response(unit.head<3>(), unit.tail<3>()));
      if (column.norm() > 1e-9) columns.push_back(column);
    }
  }
  Eigen::MatrixXd s(3 * n, columns.size());
  for (std::size_t c = 0; c < columns.size(); ++c) s.col(c) = columns[c];
  const Eigen::VectorXd b = dt_s * (f - dt_s * k * v) - a * prescribed;
  const Eigen::MatrixXd small = s.transpose() * a * s;
  return prescribed + s * small.completeOrthogonalDecomposition().solve(s.transpose() * b);
}

void ExpectDenseSolution(SpringWorld& world) {
  const double dt_s = 0.05;
  const Eigen::VectorXd dense = DenseChange(world, dt_s);
  world.Solve(dt_s);
  double worst = 0;
  for (int p = 0; p < world.model.particle_count(); ++p) {
    worst = std::max(worst, (world.state.velocity_change_m_s[p] - dense.segment<3>(3 * p)).norm());
    // What the forces handed on lead to.
    const Vec3 change = world.subspace->kicked_velocity_m_s()[p] - world.state.velocity_m_s[p];
    worst = std::max(worst, (change - dense.segment<3>(3 * p)).norm());
  }
  // Conjugate gradients to 1e-12 of the forces; dt^2 K / m is about 1.
  EXPECT_LT(worst, 1e-10 * dense.cwiseAbs().maxCoeff());
  EXPECT_EQ(world.report.bits, 0u);
}

TEST(ImplicitSolver, FreeParticlesMatchADenseSolution) {
  SpringWorld world = Cloud(false);
  world.Start();
  ExpectDenseSolution(world);
}

TEST(ImplicitSolver, PinsMatchADenseSolutionWithDampingAndGravity) {
  SpringWorld world = Cloud(true, 5, 0.5);
  world.gravity_m_s2 = {0, 0, -9.81};
  world.Start();
  ExpectDenseSolution(world);
}

TEST(ImplicitSolver, ZonesOfEveryKindMatchADenseSolution) {
  SpringWorld world = Cloud(true, 5, 0.5);
  world.model.tools.resize(1);
  // On a line: two rotations move them, the third nothing.
  for (int p : {7, 8, 9}) world.model.rest_position_m[p] = Vec3(0.1 * p, 0.3, 0);
  world.model.rest_position_m[36] = world.model.rest_position_m[37] + Vec3(0.3, 0, 0);
  world.Start();
  world.state.tools[0].pose.position_m = Vec3(0.1, 0.2, 0.3);
  world.tool_twist[0] = {Vec3(0.4, -0.2, 0.1), Vec3(0.3, 0.5, -0.7)};
  world.SetZones({{{0, 1, 2, 3, 4}, -1},   // free
                  {{5, 6}, -1},            // free, of two particles
                  {{7, 8, 9}, -1},         // free, on a line
                  {{10, 11, 12, 13}, 0},   // driven
                  {{14, 15, 38}, -1},      // about a point
                  {{16, 17, 36, 37}, -1},  // about an axis
                  {{18}, -1}});            // one particle
  ExpectDenseSolution(world);
}

// One particle on a linear spring to a fixed one.
SpringWorld Oscillator(double stiffness_n_m, double damping_n_s_m = 0) {
  SpringWorld world;
  world.AddParticle({0, 0, 0}, {0, 0, 0}, 1, true);
  world.AddParticle({0.1, 0, 0});
  world.springs.springs = {{1, 0, stiffness_n_m, damping_n_s_m}};
  world.Start();
  return world;
}

TEST(ImplicitSolver, OscillatorLosesTheAmplitudeOfBackwardEuler) {
  const double k = 400, dt = 0.03;
  SpringWorld world = Oscillator(k);
  const auto amplitude = [&] {
    return std::sqrt(world.state.position_m[1].squaredNorm() +
                     world.state.velocity_m_s[1].squaredNorm() / k);
  };
  for (int step = 0; step < 50; ++step) {
    const double before = amplitude();
    world.Step(dt);
    // Backward Euler's eigenvalue 1 / (1 + i w dt): exact but for round-off.
    EXPECT_NEAR(amplitude() / before, 1 / std::sqrt(1 + k * dt * dt), 1e-13);
  }
}

TEST(ImplicitSolver, FreeFallIsExact) {
  SpringWorld world = Cloud(false);
  world.springs.springs.clear();
  for (int p = 0; p < 39; ++p) {
    world.model.initial_velocity_m_s[p] = {1, 2, 3};
    // Springs at rest.
    world.springs.springs.push_back(
        {p, p + 1, 1e4, 0,
         (world.model.rest_position_m[p] - world.model.rest_position_m[p + 1]).norm()});
  }
  world.model.initial_velocity_m_s[39] = {1, 2, 3};
  world.gravity_m_s2 = {0, 0, -9.81};
  world.Start();
  const double dt = 0.01;
  const int steps = 100;
  for (int k = 0; k < steps; ++k) {
    world.Step(dt);
    EXPECT_EQ(world.implicit->iterations(), 0);
  }
  for (int p = 0; p < 40; ++p) {
    const Vec3 expected = world.model.rest_position_m[p] + steps * dt * Vec3(1, 2, 3) +
                          0.5 * dt * dt * steps * (steps + 1) * world.gravity_m_s2;
    // Round-off of a hundred steps of springs of 1e4 N/m.
    EXPECT_LT((world.state.position_m[p] - expected).norm(), 1e-11);
  }
}

TEST(ImplicitSolver, BooksBalanceAndTheStepTakesEnergy) {
  for (const double damping : {0.0, 3.0}) {
    SpringWorld world = Cloud(false, damping);
    world.Start();
    world.SetZones({{{0, 1, 2, 3, 4}, -1}, {{5, 6}, -1}});
    double before = 0;
    for (int step = 0; step < 100; ++step) {
      world.Step(0.02);
      world.Forces();  // closes the books of the step
      // Lost by the time integration: 1/2 dv M dv + 1/2 dx K dx of linear springs, never gained.
      EXPECT_GE(world.state.ledger.numerical_j - before,
                -1e-13 * EnergyReference(world.state.ledger));
      before = world.state.ledger.numerical_j;
    }
    // Every term by its own formula: round-off of sums over forty particles.
    EXPECT_LT(IdentityError(world.state.ledger), 1e-12);
    EXPECT_GT(world.state.ledger.numerical_j, 0);
    // The solver's tolerance of 1e-12, once a step.
    EXPECT_LT(MomentumBalance(world.model, world.state).linear, 1e-9);
  }
}

TEST(ImplicitSolver, AtRestItStopsAtOnce) {
  SpringWorld world = Cloud(true);
  world.gravity_m_s2 = {0, 0, -9.81};
  world.model.tolerance = 1e-3;
  for (Vec3& v : world.model.initial_velocity_m_s) v.setZero();
  world.Start();
  // Linear springs to linear equilibrium: the solve is exact, and damped by the step itself.
  for (int step = 0; step < 400; ++step) world.Step(0.5);
  EXPECT_EQ(world.implicit->iterations(), 0);
}

TEST(ImplicitSolver, ToolForceIsTheRateOfChangeOfMomentum) {
  SpringWorld world = Cloud(false);
  world.model.tools.resize(1);
  world.Start();
  world.tool_twist[0] = {Vec3(0.4, -0.2, 0.1), Vec3(0.3, 0.5, -0.7)};
  world.state.tools[0].twist = world.tool_twist[0];
  world.SetZones({{{10, 11, 12, 13}, 0}});
  world.tool_impulse[0] = {};
  const auto momentum = [&] {
    Vec3 sum = Vec3::Zero();
    for (int p = 0; p < 40; ++p) sum += world.model.mass_kg[p] * world.state.velocity_m_s[p];
    return sum;
  };
  const Vec3 before = momentum();
  for (int step = 0; step < 50; ++step) world.Step(0.02);
  // Fifty solves to 1e-12.
  EXPECT_LT((world.tool_impulse[0].force_n + momentum() - before).norm(), 1e-10 * before.norm());
}

TEST(ImplicitSolver, NewtonFindsTheStretchedSpringsClosedForm) {
  SpringWorld world;
  world.model.integrator = Integrator::kNewton;
  world.AddParticle({0, 0, 0}, {0, 0, 0}, 1, true);
  world.AddParticle({1.5, 0, 0});
  world.springs.springs = {{1, 0, 400, 0, 1}};
  world.Start();
  double x = 1.5, v = 0;
  const double dt = 0.05, w_sq = 400;
  for (int step = 0; step < 20; ++step) {
    world.Step(dt);
    // Along its axis the spring is linear while it does not turn over.
    v = (v - dt * w_sq * (x - 1)) / (1 + w_sq * dt * dt);
    x += dt * v;
    EXPECT_NEAR(world.state.position_m[1].x(), x, 1e-11);
    EXPECT_NEAR(world.state.velocity_m_s[1].x(), v, 1e-10);
  }
}

TEST(ImplicitSolver, NewtonMeetsTheEquationOfBackwardEuler) {
  SpringWorld world = Cloud(true, 2, 0.8);
  world.model.integrator = Integrator::kNewton;
  world.gravity_m_s2 = {0, 0, -9.81};
  world.Start();
  for (int step = 0; step < 30; ++step) {
    const std::vector<Vec3> v = world.state.velocity_m_s;
    world.Step(0.02);
    EXPECT_EQ(world.report.bits, 0u);
    std::vector<Vec3> elastic(40, Vec3::Zero()), damping(40, Vec3::Zero());
    world.springs.AddForces(
        {world.state.position_m, world.state.velocity_m_s, 0, {}, world.parallel.get()},
        {elastic, damping, {}, {}});
    double worst = 0, largest = 0;
    for (int p = 0; p < 36; ++p) {
      const Vec3 f = elastic[p] + damping[p] + world.model.mass_kg[p] * world.gravity_m_s2;
      worst = std::max(
          worst, (world.model.mass_kg[p] * (world.state.velocity_m_s[p] - v[p]) / 0.02 - f).norm());
      largest = std::max(largest, f.norm());
    }
    // Asked for 1e-12 in the preconditioner's norm.
    EXPECT_LT(worst, 1e-10 * largest);
  }
}

TEST(ImplicitSolver, TheLinearStepNearsNewtonsAsTheStepShrinks) {
  const auto end = [](Integrator integrator, double dt_s) {
    SpringWorld world = Cloud(true, 2, 0.8);
    world.model.integrator = integrator;
    for (Vec3& v : world.model.initial_velocity_m_s) v *= 0.1;
    world.Start();
    for (int step = 0; step < std::lround(0.02 / dt_s); ++step) world.Step(dt_s);
    return world.state.position_m;
  };
  const auto difference = [&](double dt_s) {
    const auto linear = end(Integrator::kImplicit, dt_s), newton = end(Integrator::kNewton, dt_s);
    double sum = 0;
    for (std::size_t p = 0; p < linear.size(); ++p) sum += (linear[p] - newton[p]).squaredNorm();
    return std::sqrt(sum);
  };
  const double coarse = difference(1e-3), fine = difference(0.5e-3);
  // What linearising leaves is of second order in dt a step, so of first order at least at the end.
  EXPECT_GT(std::log2(coarse / fine), 0.9);
  EXPECT_LT(fine, 1e-2);
}

TEST(ImplicitSolver, ThreadsAndInstructionSetsChangeNoBit) {
  const auto run = [](int threads, Simd simd) {
    SpringWorld world;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int p = 0; p < 3000; ++p) {
      world.AddParticle({uniform(random), uniform(random), uniform(random)}, Vec3::Zero(), 0.01,
                        p < 5);
      if (p > 0) world.springs.springs.push_back({p, static_cast<int>(random() % p), 50, 0.1});
    }
    world.parallel = std::make_unique<Parallel>(threads, simd);
    world.Start();
    world.SetZones({{{100, 200, 300, 400}, -1}, {{7, 8, 9}, -1}});
    for (int step = 0; step < 3; ++step) world.Step(0.01);
    return world.state;
  };
  const State expected = run(1, Simd::kBaseline);
  for (const Simd simd : AvailableSimd()) {
    for (const int threads : {1, 3}) {
      const State got = run(threads, simd);
      EXPECT_EQ(got.position_m, expected.position_m) << SimdName(simd) << ", " << threads;
      EXPECT_EQ(got.ledger.elastic_work_j, expected.ledger.elastic_work_j);
    }
  }
}

TEST(ImplicitSolver, MomentumIsBalancedAtAnyTolerance) {
  for (const bool pins : {false, true}) {
    SpringWorld world = Cloud(pins, 3);
    world.model.tools.resize(1);
    world.model.tolerance = 0.5;
    world.gravity_m_s2 = {0, 0, -9.81};
    world.Start();
    world.tool_twist[0] = {Vec3(0.4, -0.2, 0.1), Vec3(0.3, 0.5, -0.7)};
    world.SetZones({{{0, 1, 2, 3, 4}, -1}, {{10, 11, 12}, 0}, {{20, 21}, -1}});
    OpenLedgers(world.model, &world.state);
    for (int step = 0; step < 50; ++step) world.Step(0.02);
    // Round-off of fifty steps.
    EXPECT_LT(MomentumBalance(world.model, world.state).linear, 1e-13);
  }
}

TEST(ImplicitSolver, WhatIsNoNumberReachesTheState) {
  SpringWorld world = Oscillator(400);
  world.state.velocity_m_s[1].x() = std::numeric_limits<double>::quiet_NaN();
  world.Step(0.01);
  EXPECT_FALSE(std::isfinite(world.state.position_m[1].x()));
  EXPECT_TRUE(world.report.bits & kStepNotConverged);
}

TEST(ImplicitSolver, SaysThatItStoppedAtItsLimit) {
  SpringWorld world = Cloud(false);
  world.model.max_iterations = 2;
  world.Start();
  world.Step(0.05);
  EXPECT_EQ(world.report.bits, kStepNotConverged);
  EXPECT_EQ(world.implicit->iterations(), 2);
}

}  // namespace
}  // namespace adhesim
