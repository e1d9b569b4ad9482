#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/count_allocations.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"
#include "tests/support/test_size.h"

// Deformable bodies that are tied where they touch (zone mode T).
namespace adhesim::test {
namespace {

std::string Replaced(std::string scene, const std::string& what, const std::string& by) {
  const std::size_t at = scene.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return scene.replace(at, what.size(), by);
}

int Tied(const Engine& engine) {
  const std::vector<Bond>& bonds = engine.state().contacts.bonds;
  return static_cast<int>(
      std::count_if(bonds.begin(), bonds.end(), [](const Bond& bond) { return bond.tied; }));
}

TEST(Ties, ConserveBothMomentaAndBalanceTheLedgerWhileSpinningBodiesStickAndPart) {
  auto engine = EngineOf(Replaced(kChurningCells, "capture_distance_m: 0.012",
                                  "capture_distance_m: 0.012, ties: true"));
  const int steps = TestSize(1500, 10000);
  int captures = 0, releases = 0, most = 0;
  double captured = 0, deepest_m = 0, tied_j = 0, gained_j = 0;
  int inside = 0;
  long allocated = 0;
  for (int step = 0; step < steps; ++step) {
    const long before = allocations;
    const StepReport report = engine->Step({});
    allocated += allocations - before;
    // Releases that go on in the next step are counted, not lost.
    ASSERT_EQ(report.bits & ~static_cast<std::uint32_t>(kStepReleasePasses), 0u) << step;
    captures += report.captures;
    releases += report.releases;
    most = std::max(most, Tied(*engine));
    EXPECT_GE(engine->state().ledger.captured_j, captured);
    captured = engine->state().ledger.captured_j;
    gained_j += std::max(0.0, engine->state().ledger.tie_j - tied_j);
    tied_j = engine->state().ledger.tie_j;
    if (step % 100 != 99) continue;
    const Penetration now = MeasurePenetration(engine->model(), engine->state().position_m);
    deepest_m = std::max(deepest_m, now.max_depth_m);
    inside += now.vertices_inside;
  }
  EXPECT_EQ(allocated, 0);
  EXPECT_GT(captures, 100);
  EXPECT_GT(releases, 100);
  EXPECT_GT(most, 10);
  EXPECT_EQ(inside, 0);
  EXPECT_LE(deepest_m, 0.012);
  const Ledger& ledger = engine->state().ledger;
  // Round-off of 252 particles is 1e-15; what the solver of ties leaves, 1e-12.
  EXPECT_LE(IdentityError(ledger), 1e-10);
  EXPECT_LE(engine->MechanicalEnergy(),
            ledger.initial_j + ledger.external_work_j + 0.01 * EnergyReference(ledger));
  // Second order in dt, of either sign; what yields only takes.
  EXPECT_LT(ledger.tie_j, 0);
  EXPECT_LT(gained_j, 1e-3 * EnergyReference(ledger));
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
}

// Two equal sheets, particle over particle, that fields pull apart evenly.
std::string TwoSheets(const std::string& strength, double pull_pa, int rate_hz,
                      const std::string& mesh = "columns: 5, rows: 4") {
  const auto sheet = [&](const char* name, const char* z, const char* vz) {
    return std::string("  - {name: ") + name + ", sheet: {length_m: 0.4, width_m: 0.3, " + mesh +
           "}, mass_kg: 1, position_m: [0, 0, " + z + "], velocity_m_s: [0, 0, " + vz + "]}\n";
  };
  // 1 kg on 0.12 m^2; the fields' centres are so far off that all is pulled alike.
  const std::string pull = std::to_string(pull_pa * 0.12);
  return "rate_hz: " + std::to_string(rate_hz) + "\nbodies:\n" + sheet("a", "0.002", "-0.001") +
         sheet("b", "-0.002", "0.001") + R"(
effects:
  - shape_memory: {stiffness_n_m: 1000, damping_n_s_m: 1}
  - attraction: {bodies: [a], point_m: [0, 0, 1.0e+6], acceleration_m_s2: )" +
         pull + R"(}
  - attraction: {bodies: [b], point_m: [0, 0, -1.0e+6], acceleration_m_s2: )" +
         pull + "}\n  - virtual_adhesive: {capture_distance_m: 0.008, ties: true" + strength +
         "}\n";
}

// Every particle gets the part of the pull that its area has.
std::unique_ptr<Engine> EvenlyPulled(const std::string& scene) {
  auto model = std::make_shared<Model>(*ModelOf(scene));
  for (int p = 0; p < model->particle_count(); ++p) model->mass_kg[p] = model->area_m2[p] / 0.12;
  return EngineOf(model);
}

// Whether they still hold after half a second.
bool SheetsHold(const std::string& strength, double pull_pa, int rate_hz, bool shall) {
  auto engine = EvenlyPulled(TwoSheets(strength, pull_pa, rate_hz));
  engine->Step({});
  if (shall) {
    EXPECT_EQ(Tied(*engine), 20);  // one side's particles
  }
  StepMany(engine.get(), rate_hz / 2);
  return Tied(*engine) > 0;
}

// A symmetric pull-off, whatever the step.
TEST(Ties, LetGoAtStrengthTimesArea) {
  const std::string strength = ", normal_strength_pa: 10";
  for (const int rate_hz : {500, 1000, 2000}) {
    EXPECT_TRUE(SheetsHold(strength, 9.9, rate_hz, true)) << rate_hz;
    EXPECT_FALSE(SheetsHold(strength, 10.1, rate_hz, false)) << rate_hz;
  }
}

// kappa_adh: kappa m / dt_ref^2 a particle, here 1e-5 m / (1 ms)^2 on 1 kg / 0.12 m^2: 83.3 Pa, at
// any rate.
TEST(Ties, LetGoAtKappaTimesMass) {
  const std::string strength = ", kappa_adh_m: 1.0e-5, dt_ref_s: 0.001";
  const double limit_pa = 1e-5 / 1e-6 / 0.12;
  for (const int rate_hz : {1000, 2000}) {
    EXPECT_TRUE(SheetsHold(strength, 0.99 * limit_pa, rate_hz, true)) << rate_hz;
    EXPECT_FALSE(SheetsHold(strength, 1.01 * limit_pa, rate_hz, false)) << rate_hz;
  }
}

// Ties that break by chance decay as exp(-k t), and e times as fast under Bell's force. Of 336 the
// standard deviation of those left is sqrt(336 p (1 - p)); four of them are allowed.
TEST(Ties, BreakByChanceAtBellsRate) {
  const auto left = [](double rate_per_s, double force_n, int steps) {
    auto engine = EvenlyPulled(TwoSheets(", bell: {rate_per_s: " + std::to_string(rate_per_s) +
                                             ", force_n: " + std::to_string(force_n) + "}",
                                         1, 1000, "columns: 21, rows: 16"));
    engine->Step({});
    StepMany(engine.get(), steps - 1);
    return Tied(*engine);
  };
  const auto expect = [](int now, double part) {
    EXPECT_NEAR(now, 336 * part, 4 * std::sqrt(336 * part * (1 - part)));
  };
  expect(left(7, 1e6, 100), std::exp(-0.7));
  // An inner particle has 4e-4 m^2 and so 0.4 mN. What lets go leaves its neighbours' loads as they
  // are: each particle is pulled by itself, and soft springs carry little of it to others so soon.
  expect(left(7, 4e-4, 10), std::exp(-0.07 * M_E));
}

std::pair<Vec3, Vec3> Centres(const Engine& engine) {
  std::pair<Vec3, Vec3> centres{Vec3::Zero(), Vec3::Zero()};
  for (int p = 0; p < engine.model().particle_count(); ++p) {
    const Body& body = engine.model().bodies[engine.model().body_of[p]];
    (body.name == "a" ? centres.first : centres.second) +=
        engine.model().mass_kg[p] * engine.state().position_m[p];
  }
  return centres;
}

// Two cells that collide, turn about each other and part; `common` is added to both velocities.
std::pair<Vec3, Vec3> Collide(bool swapped, double common_m_s) {
  const auto cell = [&](const char* name, const char* shape, double vx, double vz) {
    return std::string("  - {name: ") + name + ", mass_kg: 1, " + shape + ", velocity_m_s: [" +
           std::to_string(vx + common_m_s) + ", 0, " + std::to_string(vz) + "]}\n";
  };
  const std::string a =
      cell("a", "icosphere: {radius_m: 0.6}, position_m: [0.2, 0, 0.62]", 0.3, -1);
  const std::string b =
      cell("b", "icosphere: {radius_m: 0.5}, position_m: [-0.2, 0.1, -0.6]", -0.2, 1);
  auto engine = EngineOf("bodies:\n" + (swapped ? b + a : a + b) + R"(
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 3, ties: true}
)");
  const ContactCounts counts = CountContacts(engine.get(), 600);
  EXPECT_GT(counts.captures, 4);
  EXPECT_GT(counts.releases, 4);
  auto centres = Centres(*engine);
  const Vec3 travelled(0.6 * common_m_s, 0, 0);
  return {centres.first - travelled, centres.second - travelled};
}

// To round-off, a thousand times larger for each of some e-foldings of an impact.
TEST(Ties, DependNeitherOnTheOrderOfBodiesNorOnACommonVelocity) {
  const auto plain = Collide(false, 0);
  const auto swapped = Collide(true, 0), moving = Collide(false, 7);
  EXPECT_LT((swapped.first - plain.first).norm(), 1e-8);
  EXPECT_LT((swapped.second - plain.second).norm(), 1e-8);
  EXPECT_LT((moving.first - plain.first).norm(), 1e-8);
  EXPECT_LT((moving.second - plain.second).norm(), 1e-8);
}

// How far the lower end of a bar of 4 x 4 x 8 cm sinks under its weight: of one piece, or of two
// halves that stick, the lower one's mesh being finer by one cell. Nearly at rest after 1 s.
double Sinks(int cells, const std::string& adhesive) {
  const auto half = [](const char* name, double height_m, int n, double z_m, const char* more) {
    return std::string("  - {name: ") + name + ", block: {size_m: [0.04, 0.04, " +
           std::to_string(height_m) + "]}, tetrahedra: {cells: " + std::to_string(n) +
           "}, density_kg_m3: 1000, position_m: [0, 0, " + std::to_string(z_m) + "]" + more + "}\n";
  };
  const char* held = ", fixed: [half_space: {point_m: [0, 0, 0.0399], normal: [0, 0, -1]}]";
  const bool one = adhesive.empty();
  const std::string bodies =
      one ? half("bar", 0.08, 2 * cells, 0, held)
          : half("upper", 0.04, cells, 0.02, held) +
                half("lower", 0.04, cells + 1, -0.0202, ", velocity_m_s: [0, 0, 0.01]");
  auto engine =
      EngineOf("rate_hz: 1000\nintegration: {integrator: explicit}\nbodies:\n" + bodies + R"(
effects:
  - elasticity: {young_modulus_pa: 3000, poisson_ratio: 0.4}
  - drag: {rate_per_s: 60}
  - uniform_gravity: {}
)" + (one ? "" : "  - virtual_adhesive: {capture_distance_m: 0.0004" + adhesive + "}\n"));
  StepMany(engine.get(), kSanitized ? 200 : 1000);
  double z = 0, mass = 0;
  const Model& model = engine->model();
  for (int p = 0; p < model.particle_count(); ++p) {
    if (model.rest_position_m[p].z() > -0.0399) continue;
    z += model.mass_kg[p] * (engine->state().position_m[p].z() - model.rest_position_m[p].z());
    mass += model.mass_kg[p];
  }
  return -z / mass;
}

// Mode T converges to perfect bonding, here with the square of the cells' size or faster (2.3,
// 0.14, 0.04 % were measured); mode R freezes a whole cross section, which cannot narrow as its bar
// is stretched, and is too stiff by 31, 20 and 11 %.
TEST(Ties, TwoHalvesOfABarBecomeOneBarUnderRefinement) {
  if (kSanitized) GTEST_SKIP() << "long runs of what shorter tests do";
  const std::pair<int, double> limits[] = {{1, 0.04}, {2, 0.01}, {4, 0.0025}};
  for (const auto& [cells, limit] : limits) {
    const double whole_m = Sinks(cells, "");
    EXPECT_LT(std::abs(Sinks(cells, ", ties: true") / whole_m - 1), limit) << cells;
    if (cells < 4) {
      EXPECT_LT(Sinks(cells, ", ties: false") / whole_m - 1, -0.1) << cells;
    }
  }
}

TEST(Ties, AreRefusedWhereTheyAreNotSolved) {
  const SceneFile both =
      ParseScene(Replaced(kChurningCells, "capture_distance_m: 0.012",
                          "capture_distance_m: 0.012, ties: true, friction_coefficient: 0.3"),
                 "test.yaml", ADHESIM_SOURCE_DIR);
  EXPECT_FALSE(both.ok());
}

}  // namespace
}  // namespace adhesim::test
