#include <set>

#include "tests/support/test_size.h"
#include "tests/tissue/tissue_sample.h"

// What tools and adhesives carry, against the momentum of the tissue and against its weight.
namespace adhesim::test {
namespace {

Vec3 Momentum(const Engine& engine) {
  Vec3 sum = Vec3::Zero();
  for (int p = 0; p < engine.model().particle_count(); ++p) {
    sum += engine.model().mass_kg[p] * engine.state().velocity_m_s[p];
  }
  return sum;
}

// A needle presses 5 mm into a block, draws sideways and pulls; it sticks.
constexpr char kPressAndPull[] = R"(tools:
  - name: needle
    needle: {radius_m: 0.004, tip_length_m: 0.008}
    position_m: [0.003, 0.002, 0.0515]
    coupling: {stiffness_n_m: 5000, max_speed_m_s: 0.1}
    adhesion: {normal_strength_pa: 1e5}
    trajectory:
      - {t_s: 0, position_m: [0.003, 0.002, 0.0515]}
      - {t_s: 0.2, position_m: [0.003, 0.002, 0.045]}
      - {t_s: 0.3, position_m: [0.006, 0.002, 0.045]}
      - {t_s: 0.6, position_m: [0.006, 0.002, 0.06]}
)";

TissueSample PressedBlock(double tolerance) {
  TissueSample sample;
  sample.cells = 8;
  sample.poisson_ratio = 0.45;
  sample.tolerance = tolerance;
  sample.bodies_and_tools = kPressAndPull;
  sample.effects = "  - virtual_adhesive: {capture_distance_m: 0.001}\n";
  return sample;
}

struct ForceError {
  double relative;  // largest difference over the largest force
  double peak_n;
};

// A free block: nothing but the tool changes its momentum, so the force on the tool is minus its
// rate of change, whatever happens inside.
ForceError ErrorOfFreeBlock(double tolerance) {
  const auto engine = EngineOf(PressedBlock(tolerance).Make());
  ForceError error{0, 0};
  for (int step = 0; step < 140; ++step) {
    const Vec3 before = Momentum(*engine);
    EXPECT_EQ(engine->Step({}).bits, 0u);
    const Vec3 rate_n = (Momentum(*engine) - before) / engine->model().dt_s;
    const Vec3& force_n = engine->state().tools[0].tissue.force_n;
    error.relative = std::max(error.relative, (rate_n + force_n).norm());
    error.peak_n = std::max(error.peak_n, force_n.norm());
  }
  error.relative /= error.peak_n;
  return error;
}

// A block that is held at its bottom and heavy. What the pins carry is found apart from the engine:
// minus the elastic force and the weight of what they hold, at the end of the step, where Newton's
// step has its forces.
ForceError ErrorOfHeldBlock(double tolerance) {
  TissueSample sample = PressedBlock(tolerance);
  sample.integrator = Integrator::kNewton;
  sample.fixed = "[half_space: {point_m: [0, 0, -0.0499], normal: [0, 0, 1]}]";
  // So far that every step is one sub-step: forces are those at its end, not a mean.
  sample.effects = "  - virtual_adhesive: {capture_distance_m: 0.004}\n";
  sample.effects += "  - uniform_gravity: {}\n";
  const auto engine = EngineOf(sample.Make());
  const Model& model = engine->model();
  const double dt_s = model.dt_s;
  ForceError error{0, 0};
  for (int step = 0; step < 140; ++step) {
    const Vec3 before = Momentum(*engine);
    EXPECT_EQ(engine->Step({}).bits, 0u);
    EXPECT_EQ(engine->substeps(), 1);
    Vec3 outside_n = -engine->state().tools[0].tissue.force_n;
    const std::vector<Vec3> elastic_n = ElasticForces(*engine);
    for (int p = 0; p < model.particle_count(); ++p) {
      if (model.fixed[p]) {
        outside_n -= elastic_n[p];
      } else {
        outside_n += model.mass_kg[p] * Vec3(0, 0, -9.81);
      }
    }
    const Vec3 rate_n = (Momentum(*engine) - before) / dt_s;
    if (engine->state().contacts.bonds.empty()) continue;
    error.relative = std::max(error.relative, (rate_n - outside_n).norm());
    error.peak_n = std::max(error.peak_n, engine->state().tools[0].tissue.force_n.norm());
  }
  error.relative /= error.peak_n;
  return error;
}

// To round-off at any tolerance: after the solve, what is loose is moved as a whole until its
// residuals sum to nothing. (The error against a converged solve does fall with the tolerance:
// docs/tissue.md.)
TEST(ToolForce, IsTheRateOfChangeOfAFreeBlocksMomentum) {
  if (kSanitized) GTEST_SKIP() << "long; shorter runs of the same are in tests/engine";
  for (double tolerance : {1e-2, 1e-4, 1e-8}) {
    const ForceError error = ErrorOfFreeBlock(tolerance);
    char what[60];
    std::snprintf(what, sizeof what, "free block, tolerance %.0e", tolerance);
    Tell(what, error.relative);
    EXPECT_GT(error.peak_n, 0.1);
    EXPECT_LT(error.relative, 1e-11);
  }
}

// Newton's step stops at its tolerance, which is of the elastic forces.
TEST(ToolForce, IsWhatWeightPinsAndMomentumLeaveToTheTolerance) {
  if (kSanitized) GTEST_SKIP() << "long; shorter runs of the same are in tests/engine";
  double last = 1;
  for (double tolerance : {1e-2, 1e-4, 1e-8}) {
    const ForceError error = ErrorOfHeldBlock(tolerance);
    char what[60];
    std::snprintf(what, sizeof what, "held block, tolerance %.0e", tolerance);
    Tell(what, error.relative);
    EXPECT_GT(error.peak_n, 0.1);
    EXPECT_LT(error.relative, last);
    last = error.relative;
  }
}

// A block that hangs by its upper face from a plate which never moves.
struct HangingBlock {
  static constexpr double kGravity_m_s2 = 2;
  TissueSample sample;
  double area_m2 = 0;  // of its particles that stick

  explicit HangingBlock(const std::string& mode) {
    sample.cells = 6;
    sample.size_m = {0.06, 0.06, 0.06};
    sample.poisson_ratio = 0.45;
    sample.dt_s = 0.002;
    sample.tolerance = 1e-6;
    sample.bodies_and_tools =
        "  - {name: plate, sheet: {length_m: 0.2, width_m: 0.2, columns: 3, rows: 3}, mass_kg: 1, "
        "position_m: [0, 0, 0.0305], fixed: [all: true]}\n";
    sample.effects =
        "  - drag: {rate_per_s: 20}\n  - uniform_gravity: {acceleration_m_s2: [0, 0, -2]}\n"
        "  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 1e6" +
        mode + "}\n";
  }
  double weight_n() const { return sample.density_kg_m3 * sample.size_m.prod() * kGravity_m_s2; }
  // Hanging at rest by an adhesive that does not let go.
  State Hang() {
    const std::shared_ptr<Model> model = sample.Make();
    for (int p = 0; p < model->particle_count(); ++p) {
      if (model->body_of[p] == 0) model->initial_velocity_m_s[p] = {0, 0, 0.02};
    }
    const auto engine = EngineOf(model);
    StepMany(engine.get(), 1500);
    double fastest = 0;
    for (const Vec3& v : engine->state().velocity_m_s) fastest = std::max(fastest, v.norm());
    Tell("hanging: what still moves, m/s", fastest);
    std::set<int> members;
    for (const Bond& bond : engine->state().contacts.bonds) {
      bond.ForEachMember([&](int p) { members.insert(p); });
    }
    area_m2 = 0;
    for (int p : members) area_m2 += model->body_of[p] == 0 ? model->area_m2[p] : 0;
    return engine->state();
  }
  // Whether it still hangs after half a second with this strength.
  bool Holds(const State& hanging, double strength_pa) const {
    const std::shared_ptr<Model> model = sample.Make();
    model->adhesive->strength = {strength_pa, strength_pa};
    const auto engine = EngineOf(model);
    engine->Restore(hanging);
    StepMany(engine.get(), 250);
    return !engine->state().contacts.bonds.empty();
  }
  // The weight over strength times area at which it falls.
  double CriticalRatio() {
    const State hanging = Hang();
    EXPECT_GT(area_m2, 0.06 * 0.06 * 0.99);
    const double even_pa = weight_n() / area_m2;
    double low = 0.2 * even_pa, high = 20 * even_pa;  // falls, holds
    EXPECT_FALSE(Holds(hanging, low));
    EXPECT_TRUE(Holds(hanging, high));
    while (high / low > 1.002) {
      const double middle = std::sqrt(low * high);
      (Holds(hanging, middle) ? high : low) = middle;
    }
    return even_pa / high;
  }
};

// In patches, the resultant decides: the block falls when m g exceeds the sum of strength times
// area (physics notes 3.3, item 9), to the 2 per cent that the issue asks for. As one zone that
// lets go particle by particle (mode R), what the clamped face carries of the block's own stresses
// adds to its share of the weight, most at the rim: it falls earlier.
TEST(HangingBlock, FallsWhenItsWeightExceedsStrengthTimesArea) {
  if (kSanitized) GTEST_SKIP() << "many runs of what shorter tests do";
  const double patches = HangingBlock(", patch_size_m: 10").CriticalRatio();
  Tell("mode P: weight over sum of sigma A at release", patches);
  EXPECT_NEAR(patches, 1, 0.02);
  const double particles = HangingBlock("").CriticalRatio();
  Tell("mode R: weight over sum of sigma A at release", particles);
  EXPECT_GT(particles, 0);
  EXPECT_LT(particles, 1.02);
}

}  // namespace
}  // namespace adhesim::test
