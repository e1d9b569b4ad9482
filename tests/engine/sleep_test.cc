// Bodies at rest: when they fall asleep, what wakes them, and that nothing shows of it.

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/model/diagnostics.h"
#include "tests/support/count_allocations.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

constexpr char kSleep[] = "sleep: {speed_m_s: 0.004, time_s: 0.1}\n";

// Balls that come to rest on a floor, each on a triangle of its own, within 1.1 s: a and b beside
// each other, c far from them. d has no weight, and flies into c after 1.4 s.
std::string Balls(const std::string& sleep, const std::string& order = "abcd") {
  std::string bodies;
  for (const char name : order) {
    const std::string ball =
        std::string("  - {name: ") + name + ", icosphere: {radius_m: 0.6}, mass_kg: 1, ";
    if (name == 'd') {
      bodies += ball + "position_m: [10, 0, 1], velocity_m_s: [-2, 0, 0]}\n";
      continue;
    }
    const char* x = name == 'a' ? "0" : name == 'b' ? "1.21" : "6";
    bodies += ball + "rotation_deg: [45, -35.264, 0], position_m: [" + x + ", 0, 0.59]}\n";
  }
  return "rate_hz: 1000\nbodies:\n" + bodies + R"(
  - {name: floor, sheet: {length_m: 30, width_m: 6, columns: 31, rows: 7}, mass_kg: 1,
     fixed: [half_space: {point_m: [0, 0, 0.1], normal: [0, 0, 1]}]}
effects:
  - uniform_gravity: {bodies: [a, b, c]}
  - shape_memory: {bodies: [a, b, c, d], stiffness_n_m: 400, damping_n_s_m: 3}
  - volume_preservation: {bodies: [a, b, c, d]}
  - drag: {bodies: [a, b, c], rate_per_s: 8}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 200}
)" + sleep;
}

std::span<const Vec3> Positions(const Engine& engine, const std::string& name) {
  for (const Body& body : engine.model().bodies) {
    if (body.name != name) continue;
    return std::span(engine.state().position_m).subspan(body.first_particle, body.particle_count);
  }
  ADD_FAILURE() << name;
  return {};
}

bool IsAsleep(const Engine& engine, const std::string& name) {
  for (std::size_t b = 0; b < engine.model().bodies.size(); ++b) {
    if (engine.model().bodies[b].name == name) return engine.state().sleep.Of(static_cast<int>(b));
  }
  ADD_FAILURE() << name;
  return false;
}

TEST(Sleeping, BodiesAtRestFallAsleepAndStayWhereTheyAre) {
  auto engine = EngineOf(Balls(kSleep));
  StepMany(engine.get(), 1200);
  ASSERT_EQ(engine->Step({}).sleeping, 3);  // not the one that flies, and not the floor
  EXPECT_FALSE(IsAsleep(*engine, "d"));
  EXPECT_FALSE(IsAsleep(*engine, "floor"));
  int looked_at = 0;
  for (const ParticleRange& range : engine->state().sleep.awake)
    looked_at += range.end - range.begin;
  EXPECT_EQ(looked_at, 42);  // of the one that flies
  const std::vector<Vec3> before = engine->state().position_m;
  const Frame frame = engine->MakeFrame();
  StepMany(engine.get(), 100);
  const Frame later = engine->MakeFrame();
  for (const char* name : {"a", "b", "c"}) {
    ASSERT_TRUE(IsAsleep(*engine, name));
    const std::span<const Vec3> now = Positions(*engine, name);
    const std::size_t first = now.data() - engine->state().position_m.data();
    for (std::size_t i = 0; i < now.size(); ++i) {
      EXPECT_EQ(now[i], before[first + i]);
      EXPECT_TRUE(engine->state().velocity_m_s[first + i].isZero(0));
      EXPECT_EQ(later.strain_energy_j[first + i], frame.strain_energy_j[first + i]);
    }
  }
  // Viewers see the forces that they rest by, and those hold their weight.
  ASSERT_EQ(later.contact_forces.size(), frame.contact_forces.size());
  double up_n = 0;
  for (std::size_t i = 0; i < frame.contact_forces.size(); ++i) {
    EXPECT_EQ(later.contact_forces[i].force_n, frame.contact_forces[i].force_n);
    up_n += frame.contact_forces[i].force_n[2];
  }
  EXPECT_NEAR(up_n, 3 * 9.80665, 0.5);  // they still creep by 4 mm/s at most, against drag
}

TEST(Sleeping, ATouchedSleeperAnswersLikeOneThatNeverSlept) {
  auto sleeps = EngineOf(Balls(kSleep)), never = EngineOf(Balls(""));
  StepMany(sleeps.get(), 1300);
  StepMany(never.get(), 1300);
  ASSERT_TRUE(IsAsleep(*sleeps, "c"));
  const std::vector<Vec3> rest(Positions(*never, "c").begin(), Positions(*never, "c").end());
  double moved = 0, apart = 0;
  for (int k = 0; k < 500; ++k) {
    sleeps->Step({});
    never->Step({});
    const auto c = Positions(*sleeps, "c"), same = Positions(*never, "c");
    for (std::size_t i = 0; i < c.size(); ++i) {
      moved = std::max(moved, (same[i] - rest[i]).norm());
      apart = std::max(apart, (same[i] - c[i]).norm());
    }
  }
  EXPECT_GT(moved, 0.1);  // it was hit hard
  EXPECT_LT(apart, 0.01 * moved);
  EXPECT_FALSE(IsAsleep(*sleeps, "c"));
  EXPECT_TRUE(IsAsleep(*sleeps, "a"));  // that was far away
}

TEST(Sleeping, WakesWholeIslands) {
  // a falls asleep with b, which it lies beside; what comes to b wakes both.
  const std::string scene = Balls(kSleep);
  auto engine = EngineOf(scene);
  StepMany(engine.get(), 1200);
  ASSERT_TRUE(IsAsleep(*engine, "a") && IsAsleep(*engine, "b") && IsAsleep(*engine, "c"));
  State state = engine->state();
  for (Vec3& x : state.position_m) {
    if (&x >= &state.position_m[126] && &x < &state.position_m[168]) x.x() -= 4.5;  // d
  }
  engine->Restore(state);
  int woken = 0;
  for (int k = 0; k < 400 && woken == 0; ++k) {
    engine->Step({});
    if (!IsAsleep(*engine, "a") && !IsAsleep(*engine, "b")) woken = k;
    EXPECT_EQ(IsAsleep(*engine, "a"), IsAsleep(*engine, "b"));
  }
  EXPECT_GT(woken, 0);
}

TEST(Sleeping, BooksWhatItTakes) {
  auto engine = EngineOf(Balls(kSleep));
  const double captured_j = engine->state().ledger.captured_j;
  bool slept = false, woke = false;
  for (int k = 0; k < 2500; ++k) {
    const int before = engine->state().sleep.bodies;
    engine->Step({});
    slept = slept || engine->state().sleep.bodies > before;
    woke = woke || engine->state().sleep.bodies < before;
  }
  EXPECT_TRUE(slept && woke);
  EXPECT_GT(engine->state().ledger.captured_j, captured_j);
  EXPECT_LT(IdentityError(engine->state().ledger), 1e-9);
  const MomentumError momentum = MomentumBalance(engine->model(), engine->state());
  EXPECT_LT(momentum.linear, 1e-9);  // what falls asleep gives its momentum to the ground
  EXPECT_LT(momentum.angular, 1e-9);
}

TEST(Sleeping, GivesTheSameBitsForAnyThreadsAndInstructions) {
  const auto model = ModelOf(Balls(kSleep));
  auto plain = EngineOf(model, 1, Simd::kBaseline), two = EngineOf(model, 2);
  for (int k = 0; k < 15; ++k) {
    for (Engine* engine : {plain.get(), two.get()}) StepMany(engine, 100);
    EXPECT_EQ(two->StateHash(), plain->StateHash());
  }
  EXPECT_LT(plain->state().sleep.bodies, 3);
}

TEST(Sleeping, ContinuesARestoredSnapshotWithTheSameBits) {
  auto engine = EngineOf(Balls(kSleep));
  for (const int at : {1050, 1200}) {  // some have begun to be calm; all sleep
    engine->Reset();
    StepMany(engine.get(), at);
    const State snapshot = engine->state();
    StepMany(engine.get(), 500);
    const std::uint64_t hash = engine->StateHash();
    engine->Restore(snapshot);
    StepMany(engine.get(), 500);
    EXPECT_EQ(engine->StateHash(), hash);
    auto other = EngineOf(Balls(kSleep), 2);
    other->Restore(snapshot);
    StepMany(other.get(), 500);
    EXPECT_EQ(other->StateHash(), hash);
  }
}

TEST(Sleeping, DoesNotDependOnTheOrderOfBodies) {
  auto engine = EngineOf(Balls(kSleep)), other = EngineOf(Balls(kSleep, "dbca"));
  for (int k = 0; k < 15; ++k) {
    StepMany(engine.get(), 100);
    StepMany(other.get(), 100);
    for (const char* name : {"a", "b", "c", "d"}) {
      SCOPED_TRACE(name);
      EXPECT_EQ(IsAsleep(*engine, name), IsAsleep(*other, name));
      if (k >= 13) continue;  // sums go in another order, and an impact makes round-off grow
      const auto x = Positions(*engine, name), y = Positions(*other, name);
      for (std::size_t i = 0; i < x.size(); ++i) EXPECT_LT((x[i] - y[i]).norm(), 1e-9);
    }
  }
}

TEST(Sleeping, SwitchedOffIsAsIfItWereAbsent) {
  auto off = EngineOf(Balls("sleep: {speed_m_s: 0.004, enabled: false}\n"));
  auto absent = EngineOf(Balls(""));
  StepMany(off.get(), 1300);
  StepMany(absent.get(), 1300);
  EXPECT_EQ(off->StateHash(), absent->StateHash());
  EXPECT_EQ(off->state().sleep.bodies, 0);
}

TEST(Sleeping, AllocatesNothing) {
  auto engine = EngineOf(Balls(kSleep));
  const long before = allocations;
  StepMany(engine.get(), 1500);
  EXPECT_EQ(allocations, before);
}

TEST(Sleeping, AToolWakesWhatItComesNear) {
  const std::string sleep = "sleep: {speed_m_s: 0.001, time_s: 0.05}\n";
  const std::string late = R"(
    adhesion: {normal_strength_pa: 6000}
    trajectory:
      - {t_s: 0.0, position_m: [0.003, 0.002, 0.055]}
      - {t_s: 0.1, position_m: [0.003, 0.002, 0.0803]}
      - {t_s: 0.4, position_m: [0.003, 0.002, 0.0803]}
      - {t_s: 0.6, position_m: [0.003, 0.002, 0.040]}
      - {t_s: 0.8, position_m: [0.003, 0.002, 0.040]}
)";
  std::string scene = NeedleScene(late);
  // Of 0.001 m, a tool at its largest speed would need exactly one sub-step: round-off would
  // decide.
  const std::string distance = "capture_distance_m: 0.001";
  scene.replace(scene.find(distance), distance.size(), "capture_distance_m: 0.0012");
  auto sleeps = EngineOf(scene + sleep), never = EngineOf(scene);
  StepMany(sleeps.get(), 400);
  StepMany(never.get(), 400);
  ASSERT_EQ(sleeps->state().sleep.bodies, 1);
  double peak_n = 0, apart_n = 0;
  for (int k = 0; k < 400; ++k) {
    sleeps->Step({});
    never->Step({});
    const Vec3 force = never->state().tools[0].tissue.force_n;
    peak_n = std::max(peak_n, force.norm());
    apart_n = std::max(apart_n, (sleeps->state().tools[0].tissue.force_n - force).norm());
  }
  EXPECT_GT(peak_n, 0.1);
  EXPECT_LT(apart_n, 0.01 * peak_n);
  EXPECT_EQ(sleeps->state().sleep.bodies, 0);  // what a tool holds does not sleep
}

// Slow is not at rest: the top of a flight, in a weak field, outlasts the time that is asked for.
TEST(Sleeping, WhatNothingHoldsStaysAwakeWhereAFieldPulls) {
  const auto ball = [](const std::string& gravity) {
    return EngineOf(
        "rate_hz: 1000\nbodies:\n"
        "  - {name: a, icosphere: {radius_m: 0.1}, mass_kg: 1, velocity_m_s: [0, 0, 0.003]}\n"
        "effects:\n"
        "  - shape_memory: {stiffness_n_m: 400}\n" +
        gravity + kSleep);
  };
  const auto falls = ball("  - uniform_gravity: {acceleration_m_s2: [0, 0, -0.02]}\n");
  const auto floats = ball("");
  for (int step = 0; step < 130; ++step) {
    falls->Step({});
    floats->Step({});
    EXPECT_FALSE(IsAsleep(*falls, "a")) << step;
    // 100 ms are over at the 101st look.
    EXPECT_EQ(IsAsleep(*floats, "a"), step >= 100) << step;
  }
}

// A block at rest and one that slides on the same triangles: the ground takes the friction of the
// one while it does not look at the other. Friction and weight are impulses of 0.1 Ns, so that
// 1e-9 of the largest is far above round-off and far below any of them.
TEST(Sleeping, WhatSlidesBesideASleeperIsBooked) {
  const auto engine = EngineOf(R"(
rate_hz: 1000
bodies:
  - {name: floor, sheet: {length_m: 2, width_m: 2, columns: 2, rows: 2}, mass_kg: 1, fixed: [all: true]}
  - {name: rest, block: {size_m: [0.06, 0.06, 0.03], cells: 2}, kind: rigid, mass_kg: 0.1,
     position_m: [-0.4, 0.3, 0.0155]}
  - {name: slide, block: {size_m: [0.06, 0.06, 0.03], cells: 2}, kind: rigid, mass_kg: 0.1,
     position_m: [-0.3, -0.3, 0.1], velocity_m_s: [1.5, 0, 0]}
effects:
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.002, normal_strength_pa: 0, friction_coefficient: 0.3}
sleep: {speed_m_s: 0.005, time_s: 0.05}
)");
  bool beside = false;
  for (int step = 0; step < 400; ++step) {
    engine->Step({});
    beside |= IsAsleep(*engine, "rest") && !engine->state().contacts.bonds.empty() && step > 200;
  }
  EXPECT_TRUE(beside);
  const MomentumError momentum = MomentumBalance(engine->model(), engine->state());
  EXPECT_LT(momentum.linear, 1e-9);
  EXPECT_LT(momentum.angular, 1e-9);
}

TEST(Sleeping, IsRefusedWhereBodiesAtRestAreActedOn) {
  const auto refusal = [](const std::string& scene) {
    const auto engine = Engine::Create(ModelOf(scene), {});
    return engine.ok() ? std::string("none") : std::string(engine.status().message());
  };
  const std::string cells = kChurningCells;
  EXPECT_NE(refusal(cells + kSleep).find("effects[2].attraction"), std::string::npos);
  // What grows weaker would let go in its sleep.
  EXPECT_EQ(refusal(Balls("  - drying: {gain: 2, time_constant_s: 1}\n") + kSleep), "none");
  EXPECT_NE(refusal(Balls("  - drying: {gain: 0.5, time_constant_s: 1}\n") + kSleep).find("gain"),
            std::string::npos);
  EXPECT_NE(refusal(RubbingCells() + kSleep).find("sleep: "), std::string::npos);
}

}  // namespace
}  // namespace adhesim::test
