#include "core/solve/force_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/spring_world.h"

namespace adhesim {
namespace {

using test::Cloud;
using test::SpringWorld;

// The sum of what the tool's members carry about its tip.
Vec6 ToolImpulse(const SpringWorld& world, double dt_s) {
  Vec6 sum = Vec6::Zero();
  for (int p : world.state.contacts.zone_members) {
    const Vec3 load = dt_s * world.subspace->load_n()[p];
    sum.head<3>() += load;
    sum.tail<3>() += (world.state.position_m[p] - world.state.tools[0].pose.position_m).cross(load);
  }
  return sum;
}

SpringWorld HeldCloud(double tolerance) {
  SpringWorld world = Cloud(true, 2, 0.5);
  world.model.tools.resize(1);
  world.model.tolerance = tolerance;
  world.Start();
  world.state.tools[0].pose.position_m = Vec3(0.1, 0.2, 0.3);
  world.SetZones({{{10, 11, 12, 13}, 0}});
  return world;
}

TEST(ForceError, IsTheDifferenceToTheConvergedForce) {
  const double dt = 0.05;
  SpringWorld rough = HeldCloud(0.1), exact = HeldCloud(1e-13);
  rough.Solve(dt);
  exact.Solve(dt);
  ForceError error(rough.model);
  const auto update = [&] {
    error.Update(rough.state, rough.subspace->groups(), dt, rough.implicit.get(),
                 rough.parallel.get());
  };
  const Vec6 difference = (ToolImpulse(rough, dt) - ToolImpulse(exact, dt)) / dt;
  ASSERT_GT(difference.norm(), 1e-3);
  // At once it is a bound; when its columns have converged (to 1e-3) hardly more than the error.
  for (int k = 0; k < 100; ++k) {
    update();
    EXPECT_GE(error.bars()[0].force_n, difference.head<3>().norm());
    EXPECT_GE(error.bars()[0].torque_nm, difference.tail<3>().norm());
  }
  EXPECT_LT(error.bars()[0].force_n, 1.1 * difference.head<3>().norm());
  EXPECT_LT(error.bars()[0].torque_nm, 1.1 * difference.tail<3>().norm());
}

TEST(ForceError, StiffnessIsTheChangeOfForceWithTheToolsWay) {
  const double dt = 0.05;
  SpringWorld rest = HeldCloud(1e-13);
  rest.Solve(dt);
  ForceError error(rest.model);
  for (int k = 0; k < 200; ++k) {
    error.Update(rest.state, rest.subspace->groups(), dt, rest.implicit.get(), rest.parallel.get());
  }
  double mass_kg = 0;
  for (int p : rest.state.contacts.zone_members) mass_kg += rest.model.mass_kg[p];
  for (int k = 0; k < 3; ++k) {
    SpringWorld moved = HeldCloud(1e-13);
    moved.tool_twist[0].linear_m_s = Vec3::Unit(k);
    moved.Solve(dt);
    const Vec3 change = (ToolImpulse(moved, dt) - ToolImpulse(rest, dt)).head<3>() / dt +
                        mass_kg / dt * Vec3::Unit(k);  // without the members' inertia
    // Columns to 1e-3; a way of dt.
    EXPECT_LT((error.bars()[0].stiffness_n_m.col(k) - change / dt).norm(),
              2e-3 * (change / dt).norm());
    EXPECT_LT(error.bars()[0].stiffness_n_m(k, k), 0);
  }
}

}  // namespace
}  // namespace adhesim
