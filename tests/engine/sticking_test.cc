#include <gtest/gtest.h>

#include <set>

#include "core/contact/penetration.h"
#include "core/contact/zone_builder.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

struct Outcome {
  int most_colliding = 0;
  int colliding_at_end = 0;
  double depth_m = 0;
  int inside = 0;
  double distance_m = 0;  // of the bodies' centres at the end
};

Outcome RunPair(const std::string& scene) {
  auto engine = SceneEngine(scene);
  EXPECT_EQ(engine->model().particle_count(), 84);
  EXPECT_EQ(engine->model().triangles.size(), 160u);
  Outcome outcome;
  for (int step = 0; step < 5000; ++step) {
    EXPECT_EQ(engine->Step({}).bits & ~static_cast<std::uint32_t>(kStepReleasePasses), 0u);
    outcome.most_colliding =
        std::max(outcome.most_colliding, engine->state().contacts.colliding_particles);
    if (step % 50 == 0) {
      const Penetration now = MeasurePenetration(engine->model(), engine->state().position_m);
      outcome.depth_m = std::max(outcome.depth_m, now.max_depth_m);
      outcome.inside = std::max(outcome.inside, now.vertices_inside);
    }
  }
  outcome.colliding_at_end = engine->state().contacts.colliding_particles;
  Vec3 centre[2] = {Vec3::Zero(), Vec3::Zero()};
  for (int p = 0; p < 84; ++p)
    centre[engine->model().body_of[p]] += engine->state().position_m[p] / 42;
  outcome.distance_m = (centre[0] - centre[1]).norm();
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
  return outcome;
}

// The paper's Fig. 3: the same motion, two strengths.
TEST(TwoCells, VeryAdhesiveCellsStayInContactAndLessStickyOnesPart) {
  const Outcome sticky = RunPair("paper/two_cells_sticky.yaml");
  const Outcome slippery = RunPair("paper/two_cells_slippery.yaml");
  EXPECT_GE(sticky.most_colliding, 8);
  EXPECT_GE(slippery.most_colliding, 8);
  EXPECT_GT(sticky.colliding_at_end, 0);
  EXPECT_EQ(slippery.colliding_at_end, 0);
  EXPECT_LT(sticky.distance_m, 1.4);    // two radii of 0.6 m and some stretch
  EXPECT_GT(slippery.distance_m, 2.4);  // twice what touching needs
  // No interpenetration beyond the capture distance of 0.012 m.
  EXPECT_LE(sticky.depth_m, 0.012);
  EXPECT_LE(slippery.depth_m, 0.012);
}

// Two rigid balls that stick and spin about each other: what the adhesive has to carry is m w^2 r,
// so that they fly apart above w = sqrt(2 sigma A / (m d)) and hold below.
class SpinningPair : public testing::Test {
 protected:
  static std::string Scene(double omega, double strength_pa) {
    const double r = 0.502;
    const auto ball = [&](const char* name, double side) {
      return "  - {name: " + std::string(name) +
             ", kind: rigid, icosphere: {radius_m: 0.5}, mass_kg: 1, position_m: [" +
             std::to_string(side * r) + ", 0, 0], velocity_m_s: [" + std::to_string(-side * 0.01) +
             ", " + std::to_string(side * r * omega) + ", 0], angular_velocity_rad_s: [0, 0, " +
             std::to_string(omega) + "]}\n";
    };
    return "bodies:\n" + ball("a", 1) + ball("b", -1) +
           "effects:\n  - virtual_adhesive: {capture_distance_m: 0.01, normal_strength_pa: " +
           std::to_string(strength_pa) + ", shear_strength_pa: 1e9}\n";
  }
  // Whether the pair still sticks after two turns.
  static bool Holds(double omega, double strength_pa) {
    auto engine = EngineOf(Scene(omega, strength_pa));
    int captures = 0;
    for (int step = 0; step < 5; ++step) captures += engine->Step({}).captures;
    EXPECT_GT(captures, 0) << "they never met";
    StepMany(engine.get(), static_cast<int>(2 * 2 * M_PI / omega * 1000));
    return !engine->state().contacts.bonds.empty();
  }
};

TEST_F(SpinningPair, FliesApartAtItsPredictedSpeed) {
  const double omega = 3;
  // What holds: the smaller of both sides' colliding areas.
  auto engine = EngineOf(Scene(omega, 1e9));
  StepMany(engine.get(), 5);
  double area[2] = {0, 0};
  std::set<int> counted;
  for (const Bond& bond : engine->state().contacts.bonds) {
    for (int p : {bond.particle, bond.vertices[0], bond.vertices[1], bond.vertices[2]}) {
      if (p >= 0 && counted.insert(p).second)
        area[engine->model().body_of[p]] += engine->model().area_m2[p];
    }
  }
  Vec3 centre = Vec3::Zero();
  for (int p = 0; p < 42; ++p) centre += engine->model().mass_kg[p] * engine->state().position_m[p];
  const double force = omega * omega * centre.norm();  // m w^2 r with m = 1
  const double critical_pa = force / std::min(area[0], area[1]);
  EXPECT_TRUE(Holds(omega, 1.02 * critical_pa));
  EXPECT_FALSE(Holds(omega, 0.98 * critical_pa));
}

TEST(Sticking, DoesNotDependOnACommonVelocity) {
  const auto releases = [](const char* velocity) {
    std::string scene = R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, 0, 0.62], velocity_m_s: [VX, 0, -1.0]}
  - {name: b, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, 0, -0.62], velocity_m_s: [VX, 0, 1.0]}
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 2}
)";
    for (std::size_t at; (at = scene.find("VX")) != std::string::npos;)
      scene.replace(at, 2, velocity);
    auto engine = EngineOf(scene);
    std::vector<int> history;
    for (int step = 0; step < 400; ++step) {
      const StepReport report = engine->Step({});
      history.push_back(report.captures * 1000 + report.releases);
    }
    return history;
  };
  const std::vector<int> still = releases("0");
  EXPECT_GT(std::count_if(still.begin(), still.end(), [](int k) { return k > 0; }), 1);
  EXPECT_EQ(still, releases("7"));
}

// A symmetric pull-off releases although the adhesive itself does not move (the paper's rule would
// never).
TEST(Sticking, ASymmetricPullOffReleases) {
  const auto parted = [](double acceleration) {
    const std::string a = std::to_string(acceleration);
    auto engine = EngineOf(R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, 0, 0.605], velocity_m_s: [0, 0, -0.05]}
  - {name: b, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, 0, -0.605], velocity_m_s: [0, 0, 0.05]}
effects:
  - shape_memory: {stiffness_n_m: 200, damping_n_s_m: 1}
  - volume_preservation: {}
  - attraction: {bodies: [a], point_m: [0, 0, 100], acceleration_m_s2: )" +
                           a + R"(}
  - attraction: {bodies: [b], point_m: [0, 0, -100], acceleration_m_s2: )" +
                           a + R"(}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 40}
)");
    StepMany(engine.get(), 2000);
    EXPECT_GT(engine->state().contacts.next_zone_id, 0);
    return engine->state().contacts.bonds.empty();
  };
  EXPECT_FALSE(parted(0.02));
  EXPECT_TRUE(parted(30));
}

TEST(Sticking, WithoutStrengthContactPushesButNeverPulls) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.5}, mass_kg: 1, position_m: [0, 0, 0.6], velocity_m_s: [0, 0, -1]}
  - {name: floor, sheet: {length_m: 4, width_m: 4, columns: 9, rows: 9}, mass_kg: 1, fixed: [all: true]}
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.01, normal_strength_pa: 0}
)");
  int most = 0;
  for (int step = 0; step < 3000; ++step) {
    engine->Step({});
    most = std::max(most, engine->state().contacts.colliding_particles);
  }
  EXPECT_GT(most, 4);
  EXPECT_TRUE(engine->state().contacts.bonds.empty());
  double lowest = 1e9, momentum = 0;
  for (int p = 0; p < 42; ++p) {
    lowest = std::min(lowest, engine->state().position_m[p].z());
    momentum += engine->model().mass_kg[p] * engine->state().velocity_m_s[p].z();
  }
  EXPECT_GT(lowest, 0.01);  // it bounced
  EXPECT_GT(momentum, 0.1);
}

// In patches, what lets go is decided by the resultant: a soft ball that hangs on a ceiling falls
// when m g exceeds the sum of strength times area, to 2 %. (Particle by particle it falls earlier:
// the zone also carries the ball's own stresses.) Whatever the ceiling's mesh: two triangles,
// eight, or as fine as the ball's. What is smaller than a patch is one,
// wherever it is.
TEST(Sticking, AHangingBodyFallsWhenItsWeightExceedsStrengthTimesArea) {
  const auto run = [](int columns, double strength_pa, double* area_m2) {
    const std::string n = std::to_string(columns);
    auto engine = EngineOf(R"(
bodies:
  - {name: ceiling, sheet: {length_m: 4, width_m: 4, columns: )" +
                           n + ", rows: " + n + R"(}, mass_kg: 1, fixed: [all: true]}
  - {name: ball, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1, position_m: [0.1, 0.05, -0.51], velocity_m_s: [0, 0, 0.2]}
effects:
  - shape_memory: {stiffness_n_m: 100, damping_n_s_m: 1}
  - volume_preservation: {}
  - drag: {rate_per_s: 10}
  - uniform_gravity: {acceleration_m_s2: [0, 0, -0.5]}
  - virtual_adhesive: {capture_distance_m: 0.01, patch_size_m: 10, normal_strength_pa: )" +
                           std::to_string(strength_pa) + "}\n");
    StepMany(engine.get(), 3000);
    std::set<int> members;
    for (const Bond& bond : engine->state().contacts.bonds)
      bond.ForEachMember([&](int p) { members.insert(p); });
    *area_m2 = 0;
    for (int p : members) {
      if (engine->model().body_of[p] == 1) *area_m2 += engine->model().area_m2[p];
    }
    return !members.empty();
  };
  for (const int columns : {2, 3, 21}) {
    double area_m2 = 0, ignored = 0;
    ASSERT_TRUE(run(columns, 1e6, &area_m2));
    ASSERT_GT(area_m2, 0);
    const double critical_pa = 1 * 0.5 / area_m2;
    EXPECT_TRUE(run(columns, 1.02 * critical_pa, &ignored)) << columns;
    EXPECT_FALSE(run(columns, 0.98 * critical_pa, &ignored)) << columns;
  }
}

// A ball that `gravity` presses on a floor or pulls off it.
std::unique_ptr<Engine> PressedBall(double gravity, const std::string& floor) {
  return EngineOf("bodies:\n  - {name: floor, " + floor + R"(}
  - {name: ball, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1, position_m: [0.1, 0.05, 0.51], velocity_m_s: [0, 0, -0.5]}
effects:
  - shape_memory: {bodies: [ball], stiffness_n_m: 100, damping_n_s_m: 1}
  - drag: {rate_per_s: 10}
  - uniform_gravity: {bodies: [ball], acceleration_m_s2: [0, 0, )" +
                  std::to_string(gravity) + R"(]}
  - virtual_adhesive: {capture_distance_m: 0.01, patch_size_m: 0.1}
)");
}

auto CountAcrossPatches(const Engine& engine) {
  const std::vector<Bond>& bonds = engine.state().contacts.bonds;
  return std::count_if(bonds.begin(), bonds.end(),
                       [](const Bond& bond) { return bond.calm == ZoneBuilder::kAcrossPatches; });
}

// What presses makes one zone of many patches, so that nothing passes; what pulls afterwards finds
// patches again. A pair or two at the contact's rim may still come nearer as the ball sways. The
// floor is heavy and not fixed.
TEST(Sticking, PatchesThatWerePressedTogetherAreCutAgainWhenPulled) {
  const std::string floor = "sheet: {length_m: 4, width_m: 4, columns: 41, rows: 41}, mass_kg: 1e6";
  auto pressed = PressedBall(-20, floor), pulled = PressedBall(5, floor);
  StepMany(pressed.get(), 400);
  EXPECT_GT(CountAcrossPatches(*pressed), 8) << "nothing was pressed together";
  pulled->Restore(pressed->state());
  StepMany(pulled.get(), 400);
  EXPECT_LT(2 * CountAcrossPatches(*pulled), CountAcrossPatches(*pressed));
  EXPECT_GT(pulled->state().contacts.colliding_particles, 8);
  EXPECT_LE(IdentityError(pulled->state().ledger), 1e-12);
}

// Fixed triangles hold each patch by itself, pressed or pulled, whatever their size: none joins
// another, turns about a corner or swings off.
TEST(Sticking, TheGroundHoldsPatchesAndJoinsNone) {
  for (const int columns : {2, 41}) {
    const std::string n = std::to_string(columns);
    const std::string floor = "sheet: {length_m: 4, width_m: 4, columns: " + n + ", rows: " + n +
                              "}, mass_kg: 1, fixed: [all: true]";
    auto engine = PressedBall(-20, floor), pulled = PressedBall(5, floor);
    StepMany(engine.get(), 400);
    EXPECT_EQ(CountAcrossPatches(*engine), 0);
    const std::size_t zones = engine->state().contacts.zones.size();
    EXPECT_GT(zones, 10u);
    pulled->Restore(engine->state());
    StepMany(pulled.get(), 400);
    EXPECT_EQ(pulled->state().contacts.zones.size(), zones);
    for (const Zone& zone : pulled->state().contacts.zones) {
      // Where the floor is fine its particles touch the ball's triangles, too: a pin each.
      EXPECT_GE(zone.pins, columns == 2 ? 3 : 1);
      EXPECT_EQ(zone.momentum_kg_m_s.norm(), 0);
    }
    EXPECT_LE(IdentityError(pulled->state().ledger), 1e-12);
    EXPECT_LE(MomentumBalance(pulled->model(), pulled->state()).linear, 1e-10);
  }
}

// Patches of half a radius: more zones, and everything that holds for whole zones holds.
TEST(Sticking, PatchesConserveWhatZonesConserve) {
  std::string scene = kChurningCells;
  const std::string distance = "capture_distance_m: 0.012";
  scene.replace(scene.find(distance), distance.size(), distance + ", patch_size_m: 0.1");
  auto engine = EngineOf(scene), whole = EngineOf(kChurningCells);
  std::size_t most = 0, most_whole = 0;
  for (int step = 0; step < 1500; ++step) {
    engine->Step({});
    whole->Step({});
    most = std::max(most, engine->state().contacts.zones.size());
    most_whole = std::max(most_whole, whole->state().contacts.zones.size());
  }
  EXPECT_GT(most, most_whole);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
}

// Rigid balls hang on a ceiling by bonds that break by chance: of N, N exp(-k t) are left after t,
// with k = k0 exp(m g / F_b), whatever the step.
TEST(Sticking, BellBondsBreakAtTheirRate) {
  const int count = kSanitized ? 60 : 300;
  const auto left = [&](int rate_hz, double rate_per_s, double force_n) {
    auto engine = EngineOf(
        "rate_hz: " + std::to_string(rate_hz) + R"(
bodies:
  - {name: ceiling, sheet: {length_m: 500, width_m: 2, columns: 2, rows: 2}, mass_kg: 1, fixed: [all: true]}
)" +
        [&] {
          std::string balls;
          for (int i = 0; i < count; ++i) {
            balls += "  - {name: b" + std::to_string(i) +
                     ", kind: rigid, icosphere: {radius_m: 0.5, subdivisions: 0}, mass_kg: 1, "
                     "position_m: [" +
                     std::to_string(-240 + 1.6 * i) + ", 0, -0.43], velocity_m_s: [0, 0, 0.4]}\n";
          }
          return balls;
        }() +
        R"(
effects:
  - uniform_gravity: {acceleration_m_s2: [0, 0, -2]}
  - virtual_adhesive: {capture_distance_m: 0.02, bell: {rate_per_s: )" +
        std::to_string(rate_per_s) + ", force_n: " + std::to_string(force_n) + "}}\n");
    StepMany(engine.get(), rate_hz / 10);
    const int before = static_cast<int>(engine->state().contacts.bonds.size());
    EXPECT_GT(before, 0);
    int holding[2] = {0, 0};
    for (int when : {0, 1}) {
      std::set<int> bodies;
      for (const Bond& bond : engine->state().contacts.bonds) {
        bodies.insert(engine->model().body_of[bond.particle] +
                      engine->model().body_of[engine->model().triangles[bond.triangle][0]]);
      }
      holding[when] = static_cast<int>(bodies.size());
      if (when == 0) StepMany(engine.get(), rate_hz);
    }
    EXPECT_GT(holding[0], count / 2);
    return static_cast<double>(holding[1]) / holding[0];
  };
  // 2 N on each: k = 0.4 exp(2 / 4). Of about 250 balls the share that is left after 1 s has a
  // standard deviation of 0.03, of 50 one of 0.07; three of them.
  const double expected = std::exp(-0.4 * std::exp(0.5)), tolerance = kSanitized ? 0.2 : 0.1;
  EXPECT_NEAR(left(200, 0.4, 4), expected, tolerance);
  EXPECT_NEAR(left(800, 0.4, 4), expected, tolerance);
  EXPECT_NEAR(left(200, 0, 4), 1, 0);
}

TEST(Sticking, KappaIsAStrengthOfKappaTimesMassOverReferenceStepSquared) {
  // The same strength said twice: sigma A_i and kappa m_i / dt_ref^2, with masses in proportion to
  // areas.
  const auto hash = [](const char* strength) {
    auto engine = EngineOf(std::string(R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.2, 0, 0.62], velocity_m_s: [0, 0, -1]}
  - {name: b, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [-0.2, 0, -0.62], velocity_m_s: [0, 0, 1]}
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.012, )") +
                           strength + "}\n");
    int releases = 0;
    for (int step = 0; step < 1000; ++step) releases += engine->Step({}).releases;
    return releases;
  };
  auto model = ModelOf("bodies:\n  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1}\n");
  const double strength_pa = 3;
  const double kappa = strength_pa * model->area_m2[0] / model->mass_kg[0] * 1e-6;
  const int by_strength = hash("normal_strength_pa: 3");
  EXPECT_GT(by_strength, 0);
  EXPECT_EQ(hash(("kappa_adh_m: " + std::to_string(kappa * 1e6) + "e-6, dt_ref_s: 0.001").c_str()),
            by_strength);
}

}  // namespace
}  // namespace adhesim::test
