#include <absl/strings/str_replace.h>
#include <gtest/gtest.h>

#include "core/contact/adhesive.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

TEST(Tools, TwoThatPullApartSplitWhatTheyHold) {
  auto engine = EngineOf(R"(
bodies:
  - {name: strip, sheet: {length_m: 0.04, width_m: 0.02, columns: 9, rows: 5}, mass_kg: 0.02}
tools:
  - name: left
    needle: {}
    position_m: [-0.012, 0, 0.004]
    adhesion: {normal_strength_pa: 1e9}
    trajectory:
      - {t_s: 0.0, position_m: [-0.012, 0, 0.004]}
      - {t_s: 0.1, position_m: [-0.012, 0, -0.002]}
      - {t_s: 0.3, position_m: [-0.030, 0, 0]}
  - name: right
    needle: {}
    position_m: [0.012, 0, 0.004]
    adhesion: {normal_strength_pa: 1e9}
    trajectory:
      - {t_s: 0.0, position_m: [0.012, 0, 0.004]}
      - {t_s: 0.1, position_m: [0.012, 0, -0.002]}
      - {t_s: 0.3, position_m: [0.030, 0, 0]}
effects:
  - shape_memory: {stiffness_n_m: 100, damping_n_s_m: 0.1}
  - drag: {rate_per_s: 5}
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
  StepMany(engine.get(), 600);
  ASSERT_FALSE(engine->frozen());
  std::size_t held[2] = {0, 0};
  for (const Zone& zone : engine->state().contacts.zones) {
    ASSERT_GE(zone.tool, 0);
    held[zone.tool] += zone.count;
  }
  EXPECT_GT(held[0], 0u);
  EXPECT_GT(held[1], 0u);
  // The strip is stretched between them: each is pulled towards the other, equally.
  EXPECT_GT(engine->state().tools[0].tissue.force_n.x(), 0.05);
  EXPECT_NEAR(engine->state().tools[0].tissue.force_n.x(),
              -engine->state().tools[1].tissue.force_n.x(),
              0.02 * engine->state().tools[0].tissue.force_n.x());
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
}

// Neither tool can take the ball from the other: the one that carries it stops.
TEST(Tools, WhatOneHoldsIsNotDrivenThroughAnother) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.02, subdivisions: 1}, mass_kg: 0.02, kind: rigid}
tools:
  - name: carries
    needle: {}
    position_m: [0, 0, 0.0215]
    adhesion: {normal_strength_pa: 1e7}
    trajectory:
      - {t_s: 0.0, position_m: [0, 0, 0.0215]}
      - {t_s: 0.1, position_m: [0, 0, 0.0185]}
      - {t_s: 0.4, position_m: [0.03, 0, 0.0185]}
  - {name: stands, needle: {}, position_m: [0.035, 0, -0.01]}
effects:
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
  double furthest_m = 0;
  std::uint32_t bits = 0, flags = 0;
  for (int step = 0; step < 500; ++step) {
    bits |= engine->Step({}).bits;
    flags |= engine->state().tools[0].flags;
    Vec3 centre = Vec3::Zero();
    for (const Vec3& x : engine->state().position_m)
      centre += x / static_cast<double>(engine->model().particle_count());
    furthest_m = std::max(furthest_m, centre.x());
  }
  EXPECT_GT(furthest_m, 0.01);  // it was carried
  // A face is at least 0.9 radii from the centre.
  EXPECT_LT(furthest_m, 0.035 - 0.018);
  EXPECT_TRUE(flags & kToolObstructed);
  EXPECT_FALSE(bits & kStepReleasePasses);
  // Nor is a pass spent on what cannot be caught: the ball's first triangle, near the second tool.
  const State& state = engine->state();
  ASSERT_EQ(state.contacts.zones.size(), 1u);
  const Adhesive::NearTool near{1, 0, Vec3::Constant(1.0 / 3), Vec3::UnitX(), 5e-4, true, true};
  std::vector<Vec3> moved = state.position_m;
  for (Vec3& x : moved) x.x() -= 1e-3;
  Contacts contacts = state.contacts;
  contacts.bonds.reserve(64);
  StepReport report;
  const std::vector<Pose> poses{state.tools[0].pose, state.tools[1].pose};
  EXPECT_EQ(
      Adhesive(engine->model())
          .CaptureCrossingByTools(std::span(&near, 1), state, moved, poses, &contacts, &report),
      0);
}

// A door that falls shut about the pins of one edge, onto a needle parallel to them.
constexpr char kDoor[] = R"(
bodies:
  - name: door
    kind: rigid
    sheet: {length_m: 0.04, width_m: 0.04, columns: 2, rows: 2}
    mass_kg: 0.1
    fixed: [half_space: {point_m: [-0.019, 0, 0], normal: [1, 0, 0]}]
tools:
  - name: needle
    needle: {length_m: 0.12, radius_m: 0.001}
    position_m: [0, -0.06, -0.02]
    orientation_wxyz: [0.70710678118654752, -0.70710678118654752, 0, 0]
effects:
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001}
)";

// The needle can neither take it along nor stop it, and stays on its side of it, a radius away.
TEST(Tools, GiveWayToWhatTurnsAboutItsPins) {
  auto engine = EngineOf(kDoor);
  const Model& model = engine->model();
  const Vec3 start_m = engine->state().tools[0].pose.position_m;
  int hinge = -1, free = -1;
  for (int p = 0; p < model.particle_count(); ++p) (model.fixed[p] ? hinge : free) = p;
  ASSERT_GE(hinge, 0);
  ASSERT_GE(free, 0);
  double nearest_m = 1, pushed_m = 0;
  std::uint32_t bits = 0, flags = 0;
  for (int step = 0; step < 100; ++step) {
    bits |= engine->Step({}).bits;
    const State& state = engine->state();
    const ToolState& tool = state.tools[0];
    flags |= tool.flags;
    // Both lie along y: seen from there, a point and a line.
    Vec3 along = state.position_m[free] - state.position_m[hinge];
    along.y() = 0;
    const Vec3 below = Vec3::UnitY().cross(along).normalized();
    nearest_m = std::min(nearest_m, below.dot(tool.pose.position_m - state.position_m[hinge]));
    pushed_m = std::max(pushed_m, (tool.pose.position_m - start_m).norm());
  }
  EXPECT_GT(pushed_m, 0.005);
  EXPECT_GT(nearest_m, 0.001);
  EXPECT_TRUE(flags & kToolObstructed);
  EXPECT_EQ(bits, 0u);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
}

// Not through a wall 6 mm behind it, beside the door.
TEST(Tools, GiveWayAsFarAsThereIsRoom) {
  auto engine = EngineOf(absl::StrReplaceAll(kDoor, {{"tools:", R"(
  - name: wall
    kind: rigid
    sheet: {length_m: 0.06, width_m: 0.02, columns: 2, rows: 2}
    mass_kg: 1
    position_m: [-0.006, 0.04, -0.04]
    rotation_deg: [0, 90, 0]
    fixed: [all: true]
tools:)"}}));
  double furthest_m = 1;
  for (int step = 0; step < 100; ++step) {
    engine->Step({});
    furthest_m = std::min(furthest_m, engine->state().tools[0].pose.position_m.x());
  }
  EXPECT_LT(furthest_m, -0.004);
  EXPECT_GT(furthest_m, -0.006 + 0.001);
}

// What a run of a tool into tissue shows.
struct Impact {
  double peak_n = 0, fastest_m_s = 0;
  double captured_ns = 0;  // in one step
  double lost_ns = 0;      // of all momentum, against what the coupling gave
};

Impact ImpactOf(Engine* engine, int steps) {
  const Model& model = engine->model();
  Impact impact;
  Vec3 given = Vec3::Zero();
  for (int step = 0; step < steps; ++step) {
    engine->Step({});
    const ToolState& tool = engine->state().tools[0];
    given += model.dt_s * tool.coupling.force_n;
    impact.peak_n = std::max(impact.peak_n, tool.tissue.force_n.norm());
    impact.fastest_m_s = std::max(impact.fastest_m_s, tool.twist.linear_m_s.norm());
    impact.captured_ns = std::max(impact.captured_ns, engine->CaptureImpulse(0));
  }
  const double mass_kg = model.tools[0].coupling.mass_kg;
  Vec3 momentum = mass_kg * engine->state().tools[0].twist.linear_m_s;
  for (int p = 0; p < model.particle_count(); ++p)
    momentum += model.mass_kg[p] * engine->state().velocity_m_s[p];
  impact.lost_ns = (momentum - given).norm();
  return impact;
}

// 50 g at 2 m/s that meet 0.5 kg, by 2 mm a step: where it starts decides whether it is near enough
// to catch before a step, or is caught by the look at where the step would lead.
TEST(Tools, AreSlowedByWhatTheyCatchWheneverTheyCatchIt) {
  for (const char* z : {"0.0600", "0.0605", "0.0610", "0.0615"}) {
    SCOPED_TRACE(z);
    const std::string start = std::string("[0.001, 0.002, ") + z + "]";
    auto engine = EngineOf(R"(
rate_hz: 1000
integration: {max_substeps: 1}
bodies:
  - {name: block, kind: rigid, block: {size_m: [0.04, 0.04, 0.04], cells: 2}, mass_kg: 0.5}
tools:
  - name: needle
    needle: {}
    position_m: )" + start +
                           R"(
    coupling: {mass_kg: 0.05, max_speed_m_s: 2, max_force_n: 20}
    adhesion: {normal_strength_pa: 1e9}
    trajectory:
      - {t_s: 0, position_m: )" +
                           start + R"(}
      - {t_s: 0.05, position_m: [0.001, 0.002, -0.04]}
effects:
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
    const Impact impact = ImpactOf(engine.get(), 60);
    EXPECT_GT(impact.fastest_m_s, 1.8);
    EXPECT_FALSE(engine->state().contacts.zones.empty());
    // What it loses in a plastic impact is less than its own momentum, 0.1 N s; its coupling adds
    // 20 N at most.
    EXPECT_LT(impact.peak_n, 0.1 / engine->model().dt_s + 20);
    EXPECT_GT(impact.captured_ns, 0.05);
    EXPECT_LT(impact.captured_ns, 0.1);
    // Of 0.1 N s, however it was caught: what the turn of a step leaves, to second order.
    EXPECT_LT(impact.lost_ns, 1e-4);
  }
}

// Likewise where it is not the tool itself that catches it but what the tool holds: a pad of a gram
// that it carries along.
TEST(Tools, AreSlowedByWhatTheirTissueCatches) {
  for (const char* z : {"-0.0400", "-0.0405", "-0.0410", "-0.0415"}) {
    SCOPED_TRACE(z);
    auto engine = EngineOf(std::string(R"(
rate_hz: 1000
integration: {max_substeps: 1}
bodies:
  - {name: pad, kind: rigid, block: {size_m: [0.01, 0.01, 0.01], cells: 1}, mass_kg: 0.001, position_m: [0, 0, 0.0595]}
  - {name: block, kind: rigid, block: {size_m: [0.04, 0.04, 0.04], cells: 2}, mass_kg: 0.5, position_m: [0, 0, )") +
                           z + R"(]}
tools:
  - name: needle
    needle: {}
    position_m: [0, 0, 0.065]
    coupling: {mass_kg: 0.05, max_speed_m_s: 2, max_force_n: 20}
    adhesion: {normal_strength_pa: 1e9}
    trajectory:
      - {t_s: 0, position_m: [0, 0, 0.065]}
      - {t_s: 0.1, position_m: [0, 0, -0.135]}
effects:
  - virtual_adhesive: {capture_distance_m: 0.001}
)");
    const Impact impact = ImpactOf(engine.get(), 90);
    EXPECT_GT(impact.fastest_m_s, 1.8);
    EXPECT_LT(impact.peak_n, 0.102 / engine->model().dt_s + 20);
    EXPECT_GT(impact.captured_ns, 0.05);
    EXPECT_LT(impact.captured_ns, 0.1);
    EXPECT_LT(impact.lost_ns, 1e-4);
  }
}

// A shaft that leans on an edge h above its tip turns about it: what its coupling pulls with at the
// tip, k (d - h a) with d what is left of its way where it is stopped, has the arm h about the
// edge, and the coupling's torque c a resists.
TEST(Tools, TurnAboutWhatStopsThem) {
  constexpr double kStiffness = 300, kTurning = 1, kHeight = 0.08;
  constexpr double kStopped = 0.0005, kLeft = 0.01 - kStopped;  // gap less capture distance
  auto engine = EngineOf(R"(
rate_hz: 1000
bodies:
  - name: edge
    block: {size_m: [0.02, 0.02, 0.02], cells: 4}
    mass_kg: 1
    position_m: [0.012, 0, 0.09]
    fixed: [half_space: {point_m: [0.021, 0, 0], normal: [1, 0, 0]}]
tools:
  - name: needle
    needle: {length_m: 0.12, radius_m: 0.001}
    position_m: [0, 0, 0]
    coupling: {stiffness_n_m: 300, angular_stiffness_nm_rad: 1, max_force_n: 20, max_torque_nm: 2}
    trajectory:
      - {t_s: 0, position_m: [0, 0, 0]}
      - {t_s: 0.2, position_m: [0.01, 0, 0]}
effects:
  - virtual_adhesive: {capture_distance_m: 0.0005}
)");
  StepMany(engine.get(), 1000);
  const ToolState& tool = engine->state().tools[0];
  const double angle = kStiffness * kHeight * kLeft / (kTurning + kStiffness * kHeight * kHeight);
  EXPECT_NEAR(-2 * tool.pose.orientation.y(), angle, 0.05 * angle);
  EXPECT_NEAR(tool.pose.position_m.x(), kStopped + kHeight * angle, 0.05 * kHeight * angle);
  EXPECT_TRUE(tool.flags & kToolObstructed);
}

}  // namespace
}  // namespace adhesim::test
