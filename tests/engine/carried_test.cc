// Surfaces that a coarser lattice of tetrahedra carries, in contact: what touches is the surface,
// what moves are the lattice's nodes.

#include "core/model/carried.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

// Two balls of tissue in free space that meet off centre and stick; what pulls them apart later is
// up to the test.
std::string TwoBalls(const std::string& strength, const std::string& integrator = "implicit") {
  return R"(
rate_hz: 500
integration: {integrator: )" +
         integrator + R"(, tolerance: 1e-10}
bodies:
  - {name: left, icosphere: {radius_m: 0.03, subdivisions: 2}, tetrahedra: {cells: 4}, density_kg_m3: 1000, position_m: [-0.0315, 0, 0], velocity_m_s: [0.1, 0, 0]}
  - {name: right, icosphere: {radius_m: 0.03, subdivisions: 2}, tetrahedra: {cells: 5}, density_kg_m3: 1000, position_m: [0.0315, 0.008, 0.003], velocity_m_s: [-0.1, 0.02, 0]}
effects:
  - elasticity: {young_modulus_pa: 5000, stiffness_damping_s: 0.002}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: )" +
         strength + "}\n";
}

// The largest distance of a carried particle from the weighted mean of its carriers, and of its
// velocity, over the largest of either.
double OffItsCarriers(const Engine& engine) {
  double off = 0;
  const Model& model = engine.model();
  for (const std::vector<Vec3>* values :
       {&engine.state().position_m, &engine.state().velocity_m_s}) {
    std::vector<Vec3> carried = *values;
    Carry(model, carried);
    double largest = 0, apart = 0;
    for (int p = 0; p < model.particle_count(); ++p) {
      largest = std::max(largest, carried[p].norm());
      apart = std::max(apart, (carried[p] - (*values)[p]).norm());
    }
    off = std::max(off, apart / largest);
  }
  return off;
}

int Bonds(const Engine& engine) { return static_cast<int>(engine.state().contacts.bonds.size()); }

TEST(Carried, BallsThatMeetStickAndKeepTheirMomentum) {
  auto engine = EngineOf(TwoBalls("100000"));
  ASSERT_FALSE(engine->model().carried.empty());
  double worst = 0;
  for (int step = 0; step < (kSanitized ? 120 : 200); ++step) {
    ASSERT_EQ(engine->Step({}).bits, 0u) << "step " << step;
    worst = std::max(worst, OffItsCarriers(*engine));
  }
  // Nodes of a lattice do not touch anything, those outside their surface neither.
  ASSERT_GT(Bonds(*engine), 3);
  for (const Bond& bond : engine->state().contacts.bonds) {
    bond.ForEachMember([&](int p) { EXPECT_TRUE(engine->model().OnSurface(p)); });
  }
  EXPECT_LT(worst, 1e-14);  // a mean of four: roundings
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  EXPECT_GT(engine->state().ledger.captured_j, 0);
  EXPECT_LE(MomentumBalance(engine->model(), engine->state()).linear, 1e-10);
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
}

// Explicit steps move zones as rigid bodies, so that both momenta are kept.
TEST(Carried, ExplicitStepsKeepBothMomenta) {
  auto engine = EngineOf(TwoBalls("100000", "explicit"));
  ASSERT_EQ(StepMany(engine.get(), 100), 0u);
  ASSERT_GT(Bonds(*engine), 3);
  EXPECT_LT(OffItsCarriers(*engine), 1e-14);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
}

// Ties act on what carries the surfaces.
TEST(Carried, TiedBallsKeepBothMomenta) {
  auto engine = EngineOf(TwoBalls("100000, ties: true", "explicit"));
  ASSERT_EQ(StepMany(engine.get(), kSanitized ? 60 : 100), 0u);
  const std::vector<Bond>& bonds = engine->state().contacts.bonds;
  EXPECT_GT(std::count_if(bonds.begin(), bonds.end(), [](const Bond& b) { return b.tied; }), 3);
  EXPECT_TRUE(engine->state().contacts.zones.empty());
  EXPECT_LT(OffItsCarriers(*engine), 1e-14);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
}

// A block of tissue that a lattice carries, on a floor that slopes by `angle_deg` (gravity leans
// instead); from the file of its surface, since the shape `block` is cut exactly.
std::string Incline(double angle_deg, double mu, const std::string& integrator) {
  const std::string path = testing::TempDir() + "carried_box.obj";
  std::ofstream obj(path);
  for (const double z : {-0.05, 0.05}) {
    for (const double y : {-0.1, 0.1}) {
      for (const double x : {-0.1, 0.1}) obj << "v " << x << ' ' << y << ' ' << z << '\n';
    }
  }
  obj << "f 1 3 4\nf 1 4 2\nf 5 6 8\nf 5 8 7\nf 1 2 6\nf 1 6 5\n"
         "f 3 7 8\nf 3 8 4\nf 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6\n";
  obj.close();
  const double angle = angle_deg * M_PI / 180;
  return "rate_hz: 500\nintegration: {integrator: " + integrator + R"(, tolerance: 1e-6}
bodies:
  - {name: box, mesh: {file: ")" +
         path + R"("}, tetrahedra: {cells: 3}, density_kg_m3: 1000, position_m: [0, 0, 0.051]}
  - {name: floor, sheet: {length_m: 8, width_m: 1, columns: 41, rows: 6}, mass_kg: 1, fixed: [all: true]}
effects:
  - elasticity: {young_modulus_pa: 50000, poisson_ratio: 0.3, stiffness_damping_s: 0.005}
  - uniform_gravity: {acceleration_m_s2: [)" +
         std::to_string(9.81 * std::sin(angle)) + ", 0, " +
         std::to_string(-9.81 * std::cos(angle)) + R"(]}
  - virtual_adhesive: {capture_distance_m: 0.002, normal_strength_pa: 0, friction_coefficient: )" +
         std::to_string(mu) + "}\n";
}

double MassCentreX(const Engine& engine) {
  double x = 0, mass = 0;
  const Body& body = engine.model().bodies[0];
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    x += engine.model().mass_kg[p] * engine.state().position_m[p].x();
    mass += engine.model().mass_kg[p];
  }
  return x / mass;
}

Vec3 MeanVelocity(const Engine& engine) {
  Vec3 momentum = Vec3::Zero();
  double mass = 0;
  const Body& body = engine.model().bodies[0];
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    momentum += engine.model().mass_kg[p] * engine.state().velocity_m_s[p];
    mass += engine.model().mass_kg[p];
  }
  return momentum / mass;
}

// As Sliding.ABlockOnASlopeObeysCoulomb, for what rubs and what moves being different particles.
// The block rests on its four corners and sways at 3.5 Hz: what presses is not g cos at any moment,
// and the change of the momentum across the slope says what it was. Measured 0.0007 g: where
// friction is not along the slope, since corners quiver.
TEST(Carried, ABlockOnASlopeObeysCoulomb) {
  const double mu = 0.4, critical_deg = std::atan(mu) * 180 / M_PI;
  for (const std::string integrator : {"explicit", "implicit"}) {
    {
      auto engine = EngineOf(Incline(critical_deg - 2, mu, integrator));
      ASSERT_FALSE(engine->model().carried.empty());
      // It sways until 0.7 s in implicit steps, and slips meanwhile; then it stays.
      StepMany(engine.get(), 400);
      const double settled = MassCentreX(*engine);
      StepMany(engine.get(), kSanitized ? 50 : 200);
      EXPECT_LT(std::abs(MassCentreX(*engine) - settled), 1e-4) << integrator;
    }
    const double angle = (critical_deg + 10) * M_PI / 180;
    auto engine = EngineOf(Incline(critical_deg + 10, mu, integrator));
    StepMany(engine.get(), 200);
    const Vec3 before = MeanVelocity(*engine);
    StepMany(engine.get(), 200);
    const Vec3 gained = MeanVelocity(*engine) - before;
    const double all = 0.4 * 9.81, pressed = all * std::cos(angle) + gained.z();
    EXPECT_GT(gained.x(), 0.1 * all);
    EXPECT_NEAR(gained.x(), all * std::sin(angle) - mu * pressed, 2e-3 * all) << integrator;
    const Ledger& ledger = engine->state().ledger;
    EXPECT_LT(ledger.sliding_j, 0);
    EXPECT_LE(IdentityError(ledger), 1e-9);
    EXPECT_LE(MomentumBalance(engine->model(), engine->state()).linear, 1e-9);
    EXPECT_LT(OffItsCarriers(*engine), 1e-14);
  }
}

// What rubs is in the frame at the surface, where it rubs: its forces on the block sum to what
// carries its weight.
TEST(Carried, WhatSlidesReportsItsForcesAtTheSurface) {
  auto engine = EngineOf(Incline(35, 0.2, "explicit"));
  StepMany(engine.get(), 400);
  Frame frame = engine->MakeFrame();
  double normal_n = 0, mass_kg = 0;
  for (int step = 0; step < 50; ++step) {  // a mean: it sways
    engine->Step({});
    engine->WriteFrame(&frame);
    for (const ContactForce& contact : frame.contact_forces) normal_n += contact.force_n[2] / 50;
  }
  const Body& body = engine->model().bodies[0];
  for (int k = 0; k < body.particle_count; ++k)
    mass_kg += engine->model().mass_kg[body.first_particle + k];
  EXPECT_NEAR(std::abs(normal_n) / (mass_kg * 9.81 * std::cos(35 * M_PI / 180)), 1, 0.03);
}

// What does not stick rebounds: no bond is left, and the balls part.
TEST(Carried, BallsWithoutStrengthPart) {
  auto engine = EngineOf(TwoBalls("0"));
  int most = 0;
  for (int step = 0; step < (kSanitized ? 200 : 400); ++step) {
    ASSERT_EQ(engine->Step({}).bits, 0u) << "step " << step;
    most = std::max(most, Bonds(*engine));
    ASSERT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0)
        << "step " << step;
  }
  EXPECT_GT(most, 0);
  EXPECT_EQ(Bonds(*engine), 0);
  EXPECT_LE(MomentumBalance(engine->model(), engine->state()).linear, 1e-10);
}

// A ball hangs on a fixed block by its adhesive: held, the contacts carry its weight; with a
// strength below the weight, it falls.
TEST(Carried, WhatHangsIsCarriedByItsContacts) {
  const auto hanging = [](const std::string& strength) {
    return R"(
rate_hz: 500
integration: {tolerance: 1e-10}
bodies:
  - {name: ceiling, block: {size_m: [0.1, 0.1, 0.02], cells: 6}, mass_kg: 1, position_m: [0, 0, 0.0105], fixed: [all: true]}
  - {name: lump, icosphere: {radius_m: 0.02, subdivisions: 2}, tetrahedra: {cells: 4}, density_kg_m3: 1000, position_m: [0.003, 0.002, -0.01965], velocity_m_s: [0, 0, 0.1]}
effects:
  - elasticity: {young_modulus_pa: 8000, stiffness_damping_s: 0.01}
  - uniform_gravity: {}
  - drag: {rate_per_s: 5}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: )" +
           strength + "}\n";
  };
  auto engine = EngineOf(hanging("1000000"));
  ASSERT_EQ(StepMany(engine.get(), 1500), 0u);
  ASSERT_GT(Bonds(*engine), 0);
  double mass_kg = 0;
  const Body& lump = engine->model().bodies[1];
  for (int k = 0; k < lump.particle_count; ++k)
    mass_kg += engine->model().mass_kg[lump.first_particle + k];
  Frame frame = engine->MakeFrame();
  engine->WriteFrame(&frame);
  Vec3 force = Vec3::Zero();
  for (const ContactFrame& contact : frame.contacts) {
    force += (contact.body == 1 ? 1 : -1) * contact.normal_force_n * contact.normal;  // on the lump
  }
  // Two bonds or more share the weight; what is tangential stays out of this sum.
  EXPECT_NEAR(force.z() / (mass_kg * 9.81), 1, 0.05);

  auto weak = EngineOf(hanging("1"));
  StepMany(weak.get(), 300);
  EXPECT_EQ(Bonds(*weak), 0);
  EXPECT_LT(weak->state().position_m[lump.first_particle].z(), -0.05);
}

// Placed into each other, they are pushed out until nothing is inside, without speed from it.
TEST(Carried, OverlappingBallsSeparate) {
  std::string scene = TwoBalls("0");
  for (const char* speed : {", velocity_m_s: [0.1, 0, 0]", ", velocity_m_s: [-0.1, 0.02, 0]"}) {
    const std::size_t at = scene.find(speed);
    ASSERT_NE(at, std::string::npos);
    scene.erase(at, std::string(speed).size());
  }
  const std::size_t at = scene.find("position_m: [-0.0315");
  scene.replace(at, 20, "position_m: [-0.0215");
  auto engine = EngineOf(scene);
  ASSERT_GT(MeasurePenetration(engine->model(), engine->model().rest_position_m).vertices_inside,
            0);
  StepMany(engine.get(), 500);
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
  EXPECT_FALSE(engine->frozen());
  EXPECT_LT(OffItsCarriers(*engine), 1e-13);
}

// Of a triangle that is stuck to, a corner may be in another patch than what sticks there: it is a
// zone of its own, and what carries it is in others. Such a zone has no mass, and no part in the
// step's equation.
TEST(Carried, CornersInAnotherPatchMoveAsTheyAreCarried) {
  auto engine = EngineOf(R"(
rate_hz: 500
integration: {integrator: implicit, tolerance: 1e-10}
bodies:
  - {name: left, icosphere: {radius_m: 0.03, subdivisions: 1}, tetrahedra: {cells: 2}, density_kg_m3: 1000, position_m: [-0.0315, 0, 0], velocity_m_s: [0.1, 0, 0]}
  - {name: right, icosphere: {radius_m: 0.03, subdivisions: 1}, tetrahedra: {cells: 2}, density_kg_m3: 1000, position_m: [0.0315, 0.008, 0.003], velocity_m_s: [-0.1, 0.02, 0]}
effects:
  - elasticity: {young_modulus_pa: 5000, stiffness_damping_s: 0.002}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 1e5, patch_size_m: 0.012}
)");
  const Model& model = engine->model();
  int without_mass = 0;
  for (int step = 0; step < 100; ++step) {
    ASSERT_EQ(engine->Step({}).bits, 0u) << step;
    const Contacts& contacts = engine->state().contacts;
    for (const Zone& zone : contacts.zones) {
      double mass_kg = 0;
      for (int k = zone.first; k < zone.first + zone.count; ++k)
        mass_kg += model.mass_kg[contacts.zone_members[k]];
      without_mass += mass_kg == 0;
    }
  }
  EXPECT_GT(without_mass, 100);
  EXPECT_GT(Bonds(*engine), 0);
  EXPECT_LE(OffItsCarriers(*engine), 1e-14);
  const MomentumError momentum = MomentumBalance(model, engine->state());
  EXPECT_LE(momentum.linear, 1e-10);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
}

}  // namespace
}  // namespace adhesim::test
