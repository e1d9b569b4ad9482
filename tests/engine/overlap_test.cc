#include "core/contact/overlap.h"

#include <gtest/gtest.h>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

// Bodies "a" and "b" with more words for each, and effects beside a sticky contact.
std::string Pair(const std::string& a, const std::string& b, const std::string& effects = "") {
  return "bodies:\n  - {name: a, " + a + "}\n  - {name: b, " + b + "}\neffects:\n" + effects +
         "  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 10}\n";
}

// Steps until nothing overlaps, at most `most` steps; returns how many it took.
int StepsUntilApart(Engine* engine, int most) {
  for (int step = 0; step < most; ++step) {
    if (!(engine->Step({}).bits & kStepOverlap)) return step;
  }
  return most;
}

// Two balls, each with its pole beyond the other's centre: every particle leaves by the side that
// its ball came from, although for some the nearest surface is on the opposite one.
TEST(Overlap, DepthAndDirectionAreConsistent) {
  const double r = 0.6, apart = 0.5;
  auto model = ModelOf(Pair("icosphere: {radius_m: 0.6, subdivisions: 3}, mass_kg: 1",
                            "icosphere: {radius_m: 0.6, subdivisions: 3}, mass_kg: 1, "
                            "position_m: [0.5, 0, 0]"));
  Overlap overlap(*model);
  const auto inside = overlap.Find(model->rest_position_m);
  ASSERT_GT(inside.size(), 100u);
  int nearest_is_wrong = 0;
  for (const Overlap::Inside& at : inside) {
    const Vec3& x = model->rest_position_m[at.particle];
    const bool of_a = at.body == 1;
    EXPECT_GT(of_a ? -at.direction.x() : at.direction.x(), 0.3) << x.transpose();
    nearest_is_wrong += of_a ? x.x() > apart : x.x() < 0;
    // Near the axis the way out is the lens's thickness there.
    const double offset_sq = x.y() * x.y() + x.z() * x.z();
    if (offset_sq > 0.04 * r * r) continue;
    const double other = std::sqrt(r * r - offset_sq);
    EXPECT_NEAR(at.depth_m, of_a ? x.x() - (apart - other) : other - x.x(), 0.2 * (2 * r - apart));
  }
  EXPECT_GT(nearest_is_wrong, 10);
}

// Without forces nothing ever moves by itself: what separates the bodies leaves no velocity, and
// their common centre where it was.
TEST(Overlap, EndsWithoutVelocityAndKeepsTheCentre) {
  auto engine = EngineOf(Pair("icosphere: {radius_m: 0.6}, mass_kg: 1",
                              "icosphere: {radius_m: 0.6}, mass_kg: 3, position_m: [0.9, 0.1, 0]"));
  const auto centre = [&] {
    Vec3 sum = Vec3::Zero();
    for (int p = 0; p < engine->model().particle_count(); ++p)
      sum += engine->model().mass_kg[p] * engine->state().position_m[p];
    return Vec3(sum / 4);
  };
  const Vec3 before = centre();
  ASSERT_GT(MeasurePenetration(engine->model(), engine->state().position_m).max_depth_m, 0.2);
  EXPECT_LT(StepsUntilApart(engine.get(), 1000), 1000);
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
  for (const Vec3& v : engine->state().velocity_m_s) EXPECT_EQ(v, Vec3::Zero());
  EXPECT_LT((centre() - before).norm(), 1e-13);
}

// With elasticity: volumes stay exact, the work of moving is booked as correction, the rest of the
// books stay closed, and the bodies come to lie beside each other.
TEST(Overlap, IsBookedAsCorrection) {
  auto engine = EngineOf(Pair("icosphere: {radius_m: 0.6}, mass_kg: 1",
                              "icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.9, 0.1, 0], "
                              "velocity_m_s: [0, 0.1, 0]",
                              "  - shape_memory: {stiffness_n_m: 60, damping_n_s_m: 0.2}\n"
                              "  - volume_preservation: {}\n"));
  const int steps = StepsUntilApart(engine.get(), 1000);
  EXPECT_LT(steps, 1000);
  StepMany(engine.get(), 1000);
  const Ledger& ledger = engine->state().ledger;
  EXPECT_GT(ledger.correction_j, 0);
  EXPECT_LE(IdentityError(ledger), 1e-12);
  EXPECT_LE(*VolumeError(engine->model(), engine->state()), 1e-12);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
  // Elastic and kinetic energy together never exceed what was put in by more than 1 %.
  EXPECT_LE(engine->MechanicalEnergy(),
            ledger.initial_j + ledger.correction_j + 0.01 * EnergyReference(ledger));
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
}

TEST(Overlap, EndsForWholeBodiesInsideRigidOnesAndFixedOnes) {
  for (const char* b : {
           "icosphere: {radius_m: 0.1}, mass_kg: 0.1, position_m: [0.3, 0.02, 0.01]",
           "icosphere: {radius_m: 0.1}, mass_kg: 0.1",  // in the very middle
           "kind: rigid, block: {size_m: [0.4, 0.4, 0.4], cells: 2}, mass_kg: 1, position_m: "
           "[0.5, 0.1, 0]",
           "kind: rigid, block: {size_m: [0.4, 0.4, 0.4], cells: 2}, mass_kg: 1, position_m: "
           "[0.5, 0.1, 0], fixed: [all: true]",
       }) {
    auto engine = EngineOf(Pair("icosphere: {radius_m: 0.6}, mass_kg: 1", b));
    EXPECT_LT(StepsUntilApart(engine.get(), 3000), 3000) << b;
    EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0)
        << b;
    EXPECT_LE(IdentityError(engine->state().ledger), 1e-12) << b;
  }
}

// A rigid body that is held at one end: pushing it along would carry its fixed particles away, in
// every sub-step, for ever.
TEST(Overlap, LeavesAHeldRigidBodyWhereItIs) {
  auto engine =
      EngineOf(Pair("icosphere: {radius_m: 0.6}, mass_kg: 1, kind: rigid, fixed: "
                    "[half_space: {point_m: [0, 0, -0.5], normal: [0, 0, 1]}]",
                    "icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.2, 0, 0.9]"));
  EXPECT_LT(StepsUntilApart(engine.get(), 1000), 1000);
  const Body& held = engine->model().bodies[0];
  for (int p = held.first_particle; p < held.first_particle + held.particle_count; ++p)
    EXPECT_EQ(engine->state().position_m[p], engine->model().rest_position_m[p]);
}

// All particles of each on the other's surface: neither inside nor outside.
TEST(Overlap, TwoBodiesAtTheSamePlaceComeApart) {
  for (const char* kind : {"deformable", "rigid"}) {
    const std::string ball = std::string("icosphere: {radius_m: 0.6}, mass_kg: 1, kind: ") + kind;
    auto engine = EngineOf(Pair(ball, ball));
    EXPECT_TRUE(engine->Step({}).bits & kStepOverlap);
    EXPECT_LT(StepsUntilApart(engine.get(), 1000), 1000);
    const std::vector<Vec3>& x = engine->state().position_m;
    EXPECT_EQ(MeasurePenetration(engine->model(), x).vertices_inside, 0);
    EXPECT_EQ(CountEdgesThrough(engine->model(), x), 0);
  }
}

// A soft ball so deep in a held one that its middle is inside: pushed particle by particle, it
// would wrap itself around. As a whole it comes out unstrained, and nothing is added but what is
// booked.
TEST(Overlap, DeepInAHeldBodyEndsNearlyWithoutStrain) {
  auto engine = EngineOf(R"(
bodies:
  - {name: held, icosphere: {radius_m: 0.03}, mass_kg: 1, kind: rigid, fixed: [half_space: {point_m: [0, 0, -0.025], normal: [0, 0, 1]}]}
  - {name: soft, icosphere: {radius_m: 0.03}, mass_kg: 1, position_m: [0.01, 0, 0.02]}
effects:
  - shape_memory: {stiffness_n_m: 50}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 1, friction_coefficient: 0.3}
)");
  EXPECT_LT(StepsUntilApart(engine.get(), 500), 500);
  StepMany(engine.get(), 500);
  const Ledger& ledger = engine->state().ledger;
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
  EXPECT_LE(engine->MechanicalEnergy(),
            ledger.initial_j + ledger.correction_j + 0.01 * EnergyReference(ledger));
  // Less than all of its particles would have a millimetre from where they belong: only the last
  // bit is pushed particle by particle.
  EXPECT_LE(ledger.correction_j, 42 * 0.5 * 50 * 1e-3 * 1e-3);
}

// What no motion can mend is no overlap to work on: it shows in the depth that a run measures.
TEST(Overlap, FixedInFixedIsLeftAlone) {
  auto engine = EngineOf(Pair("icosphere: {radius_m: 0.6}, mass_kg: 1, fixed: [all: true]",
                              "icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.2, 0, 1.05], "
                              "fixed: [half_space: {point_m: [0, 0, 0.9], normal: [0, 0, -1]}]"));
  ASSERT_GT(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
  EXPECT_LT(StepsUntilApart(engine.get(), 1000), 1000);
}

}  // namespace
}  // namespace adhesim::test
