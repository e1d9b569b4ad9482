#include "core/solve/tool_system.h"

#include <gtest/gtest.h>

#include "tests/support/spring_world.h"

namespace adhesim {
namespace {

using test::Cloud;
using test::SpringWorld;

// A pinned cloud that two tools hold, each in motion.
SpringWorld HeldCloud() {
  SpringWorld world = Cloud(true, 2, 0.5);
  world.model.tools.resize(2);
  world.Start();
  world.state.tools[0].pose.position_m = Vec3(0.1, 0.2, 0.3);
  world.state.tools[1].pose.position_m = Vec3(-0.4, 0.1, -0.2);
  world.tool_twist = {{Vec3(0.3, -0.2, 0.1), Vec3(0.5, 0, -0.4)}, {Vec3(0, 0.2, 0), Vec3(1, 0, 0)}};
  for (int t = 0; t < 2; ++t) world.state.tools[t].twist = world.tool_twist[t];
  world.SetZones({{{10, 11, 12, 13}, 0}, {{20}, 1}});
  return world;
}

Mat6 Inertia(double mass_kg) {
  Vec6 diagonal;
  diagonal << Vec3::Constant(mass_kg), Vec3::Constant(0.1 * mass_kg);
  return diagonal.asDiagonal();
}

// What the last solve's equation leaves to a tool in the rows of its members, about the tip, N s.
Vec6 TissueImpulse(const SpringWorld& world, int tool, double dt_s) {
  Vec6 sum = Vec6::Zero();
  const Twist& twist = world.tool_twist[tool];
  for (const Zone& zone : world.state.contacts.zones) {
    if (zone.tool != tool) continue;
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int p = world.state.contacts.zone_members[k];
      const Vec3 r = world.state.position_m[p] - world.state.tools[tool].pose.position_m;
      const Vec3 change =
          twist.linear_m_s + twist.angular_rad_s.cross(r) - world.state.velocity_m_s[p];
      const Vec3 left = dt_s * world.total_n[p] - world.model.mass_kg[p] * change;
      sum.head<3>() += left;
      sum.tail<3>() += r.cross(left);
    }
  }
  return sum;
}

// Begin() at the state's forces, as the pipeline calls it.
bool Begin(SpringWorld* world, ToolSystem* system, double dt_s, double mass_kg) {
  world->Forces();
  world->implicit->Begin(
      world->state, {},
      {{world->force_n[0], world->force_n[1], world->force_n[2], world->force_n[3]},
       world->total_n},
      dt_s, world->parallel.get());
  world->subspace->FormGroups(world->state, world->tool_twist);
  const std::vector<Mat6> own(2, Inertia(mass_kg));
  return system->Begin(world->state, world->subspace->groups(), own, dt_s, world->implicit.get(),
                       world->parallel.get());
}

TEST(ToolSystem, ToolsGetTheMomentumThatTissueGivesThemInTheStepItself) {
  const double dt = 0.1, mass_kg = 0.5;
  SpringWorld world = HeldCloud();
  ToolSystem system(world.model, 0);
  ASSERT_TRUE(Begin(&world, &system, dt, mass_kg));
  std::vector<ToolSystem::Law> laws(2);
  for (int t = 0; t < 2; ++t) laws[t].matrix = (1 + t) * Inertia(mass_kg);
  laws[0].impulse << 1, -2, 3, 0.1, 0.2, -0.3;
  laws[1].impulse << 0, 1, 0, 0, 0, 0.1;
  // What was found under other laws is only where it goes on from.
  std::vector<ToolSystem::Law> others = laws;
  others[0].impulse *= -3;
  others[1].matrix *= 5;
  system.Solve(others, &world.report, world.parallel.get());
  system.Solve(laws, &world.report, world.parallel.get());
  EXPECT_EQ(world.report.bits, 0u);
  for (int t = 0; t < 2; ++t) {
    world.tool_twist[t].linear_m_s += system.change(t).head<3>();
    world.tool_twist[t].angular_rad_s += system.change(t).tail<3>();
  }
  world.Solve(dt);
  for (int t = 0; t < 2; ++t) {
    const Vec6 balance =
        laws[t].matrix * system.change(t) - laws[t].impulse - TissueImpulse(world, t, dt);
    // Both solves to 1e-12 of impulses of some N s.
    EXPECT_LT(balance.norm(), 1e-9) << t;
    EXPECT_GT(TissueImpulse(world, t, dt).norm(), 0.1);
  }
  // And what goes with it is what the step finds.
  for (int p = 0; p < world.model.particle_count(); ++p) {
    if (world.state.contacts.zone_of[p] >= 0 || world.model.fixed[p]) continue;
    EXPECT_LT((system.change_m_s()[p].vec() - world.state.velocity_change_m_s[p]).norm(), 1e-9);
  }
}

// 750 N/m on average, some three springs a particle.
TEST(ToolSystem, IsNotNeededWhereTissueIsSoftAgainstTheTool) {
  SpringWorld world = HeldCloud();
  ToolSystem system(world.model, 0);
  EXPECT_FALSE(Begin(&world, &system, 1e-3, 0.5));
  EXPECT_TRUE(Begin(&world, &system, 0.1, 0.5));
  EXPECT_FALSE(Begin(&world, &system, 0.1, 1e4));
}

TEST(ToolSystem, HasNoneOfToolsThatHoldNothing) {
  SpringWorld world = HeldCloud();
  world.SetZones({{{10, 11, 12, 13}, 0}});
  ToolSystem system(world.model, 0);
  EXPECT_TRUE(Begin(&world, &system, 0.1, 0.5));
  EXPECT_TRUE(system.has(0));
  EXPECT_FALSE(system.has(1));
}

}  // namespace
}  // namespace adhesim
