#include <gtest/gtest.h>

#include <cmath>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

// A rigid block on a floor that slopes by `angle_deg` (gravity leans instead), released at rest.
std::string Incline(double angle_deg, double mu, double strength_pa = 0) {
  const double angle = angle_deg * M_PI / 180;
  return std::string(R"(
bodies:
  - {name: block, kind: rigid, block: {size_m: [0.2, 0.2, 0.1], cells: 2}, mass_kg: 1, position_m: [0, 0, 0.051]}
  - {name: floor, sheet: {length_m: 8, width_m: 1, )") +
         (kSanitized ? "columns: 41, rows: 6" : "columns: 161, rows: 21") +
         R"(}, mass_kg: 1, fixed: [all: true]}
effects:
  - uniform_gravity: {acceleration_m_s2: [)" +
         std::to_string(9.81 * std::sin(angle)) + ", 0, " +
         std::to_string(-9.81 * std::cos(angle)) + R"(]}
  - virtual_adhesive: {capture_distance_m: 0.002, normal_strength_pa: )" +
         std::to_string(strength_pa) + ", friction_coefficient: " + std::to_string(mu) + "}\n";
}

double BlockX(const Engine& engine) {
  double x = 0;
  const Body& block = engine.model().bodies[0];
  for (int p = 0; p < block.particle_count; ++p)
    x += engine.model().mass_kg[p] * engine.state().position_m[p].x();
  return x;
}

// Coulomb: below tan(angle) = mu it stays, above it accelerates by g (sin - mu cos).
TEST(Sliding, ABlockOnASlopeObeysCoulomb) {
  const double mu = 0.4, critical_deg = std::atan(mu) * 180 / M_PI;
  {
    auto engine = EngineOf(Incline(critical_deg - 0.5, mu));
    EXPECT_EQ(StepMany(engine.get(), 1000), 0u);
    EXPECT_LT(std::abs(BlockX(*engine)), 1e-4);  // what it slips before it has settled
  }
  for (const double over_deg : {0.5, 10.0}) {
    const double angle = (critical_deg + over_deg) * M_PI / 180;
    auto engine = EngineOf(Incline(critical_deg + over_deg, mu));
    StepMany(engine.get(), 200);
    const double x0 = BlockX(*engine);
    StepMany(engine.get(), 400);
    const double x1 = BlockX(*engine);
    StepMany(engine.get(), 400);
    const double x2 = BlockX(*engine);
    const double expected = 9.81 * (std::sin(angle) - mu * std::cos(angle));
    // To a thousandth of g. The floor is fine, so that hundreds of its particles come under the
    // block's leading edge: planes across their way would hold it up.
    EXPECT_NEAR((x2 - 2 * x1 + x0) / (0.4 * 0.4), expected, 1e-3 * 9.81) << over_deg;
    EXPECT_LT(engine->state().ledger.sliding_j, 0);
    EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
  }
}

// With adhesion: it slides when m g sin > mu m g cos + sigma A.
TEST(Sliding, AdhesionAddsToFriction) {
  const auto moved = [](double strength_pa) {
    auto engine = EngineOf(Incline(40, 0.3, strength_pa));
    StepMany(engine.get(), 500);
    return BlockX(*engine);
  };
  EXPECT_GT(moved(0), 0.2);
  EXPECT_GT(moved(20), 0.01);
  EXPECT_LT(moved(200), 1e-4);
}

// A soft ball thrown along a floor: friction slows it and turns it; both momenta balance; contact
// never adds energy.
TEST(Sliding, ASoftBallThrownAlongTheFloorIsSlowedAndTurned) {
  auto engine = EngineOf(R"(
bodies:
  - {name: ball, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1, position_m: [-2, 0, 0.52], velocity_m_s: [2, 0, 0]}
  - {name: floor, sheet: {length_m: 8, width_m: 2, columns: 17, rows: 5}, mass_kg: 1, fixed: [all: true]}
effects:
  - shape_memory: {stiffness_n_m: 100, damping_n_s_m: 0.2}
  - volume_preservation: {}
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.01, normal_strength_pa: 0, friction_coefficient: 0.3}
)");
  double sliding = 0, gained = 0;
  for (int step = 0; step < 1500; ++step) {
    EXPECT_EQ(engine->Step({}).bits, 0u);
    gained += std::max(0.0, engine->state().ledger.sliding_j - sliding);
    sliding = engine->state().ledger.sliding_j;
  }
  const Ledger& ledger = engine->state().ledger;
  EXPECT_LT(ledger.sliding_j, -0.05);
  // A contact that closes again while its force grows does work of the order dt^2, with either
  // sign.
  EXPECT_LT(gained, -1e-3 * ledger.sliding_j);
  EXPECT_LE(IdentityError(ledger), 1e-12);
  Vec3 momentum = Vec3::Zero(), spin = Vec3::Zero(), centre = Vec3::Zero();
  const int n = engine->model().bodies[0].particle_count;
  for (int p = 0; p < n; ++p) {
    momentum += engine->model().mass_kg[p] * engine->state().velocity_m_s[p];
    centre += engine->model().mass_kg[p] * engine->state().position_m[p];
  }
  for (int p = 0; p < n; ++p) {
    spin += engine->model().mass_kg[p] *
            (engine->state().position_m[p] - centre).cross(engine->state().velocity_m_s[p]);
  }
  EXPECT_LT(momentum.x(), 1.9);
  EXPECT_GT(momentum.x(), 0.5);
  EXPECT_GT(spin.y(), 0.05);  // it rolls forward
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-10);
  EXPECT_LE(error.angular, 1e-10);
  for (int p = 0; p < n; ++p) EXPECT_GT(engine->state().position_m[p].z(), 0);
}

// Two free cells that graze: what one loses the other gets.
TEST(Sliding, FreeBodiesThatGrazeConserveBothMomenta) {
  auto engine = EngineOf(R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, -0.6, 0.6], velocity_m_s: [0, 1, -0.6], angular_velocity_rad_s: [1, 0.5, 0]}
  - {name: b, icosphere: {radius_m: 0.6}, mass_kg: 2, position_m: [0, 0.6, -0.6], velocity_m_s: [0, -0.5, 0.3]}
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 0.5, friction_coefficient: 0.5}
)");
  int most = 0;
  for (int step = 0; step < 3000; ++step) {
    EXPECT_EQ(engine->Step({}).bits & ~static_cast<std::uint32_t>(kStepReleasePasses), 0u);
    most = std::max(most, engine->state().contacts.colliding_particles);
  }
  EXPECT_GT(most, 4);
  EXPECT_LT(engine->state().ledger.sliding_j, -1e-3);
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-11);
  EXPECT_LE(error.angular, 1e-11);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
  const Penetration end = MeasurePenetration(engine->model(), engine->state().position_m);
  EXPECT_LE(end.max_depth_m, 0.012);
}

// Contacts of which both sides have come into one zone by other bonds: nothing there can slide, and
// no round-off taken for mobility may make impulses of it.
TEST(Sliding, WithinOneZoneKeepsTheBooksClosed) {
  auto engine = EngineOf(R"(
rate_hz: 500
seed: 127
bodies:
  - {name: b0, sheet: {length_m: 0.0305, width_m: 0.0570, columns: 7, rows: 5}, fixed: [half_space: {point_m: [0, 0, -0.047487], normal: [0, 0, 1]}], mass_kg: 1.0000, position_m: [-0.0147, 0.0187, -0.0475], rotation_deg: [-165.6811, -95.6651, 132.8325]}
  - {name: b1, sheet: {length_m: 0.0633, width_m: 0.0562, columns: 6, rows: 6}, mass_kg: 0.0100, position_m: [0.0340, 0.0194, 0.0204], rotation_deg: [-42.2168, -172.5665, 132.7785], velocity_m_s: [-0.0650, 0.0264, -0.0276], angular_velocity_rad_s: [0.7021, -0.2429, -0.0656]}
  - {name: b2, block: {size_m: [0.0340, 0.0224, 0.0216], cells: 1}, kind: rigid, mass_kg: 0.1000, position_m: [-0.0158, 0.0188, 0.0335], rotation_deg: [-158.5552, 132.3870, 134.6346], velocity_m_s: [0.0000, 0.0000, 0.0000], angular_velocity_rad_s: [0.0000, 0.0000, 0.0000]}
  - {name: b3, block: {size_m: [0.0239, 0.0204, 0.0108], cells: 1}, mass_kg: 0.1000, position_m: [-0.0439, -0.0394, 0.0402], rotation_deg: [-40.5064, -42.7714, -43.6113], velocity_m_s: [0.4679, -0.3149, 0.1372], angular_velocity_rad_s: [-3.2202, -0.2262, -9.8664]}
  - {name: b4, sheet: {length_m: 0.0515, width_m: 0.0605, columns: 2, rows: 6}, mass_kg: 0.1000, position_m: [-0.0315, -0.0252, -0.0212], rotation_deg: [-10.6386, -114.3268, -2.6439], velocity_m_s: [-0.0563, 0.0516, 0.0148], angular_velocity_rad_s: [-0.9491, 0.2564, -0.9587]}
  - {name: b5, sheet: {length_m: 0.0520, width_m: 0.0423, columns: 6, rows: 6}, mass_kg: 0.0100, position_m: [-0.0478, 0.0011, 0.0123], rotation_deg: [18.7142, -165.2777, 123.6664], velocity_m_s: [0.8792, 0.5738, -0.7585], angular_velocity_rad_s: [-3.2632, -7.6490, 5.0560]}
effects:
  - shape_memory: {stiffness_n_m: 20, damping_n_s_m: 0.1}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.002, kappa_adh_m: 0.001, friction_coefficient: 0, bell: {rate_per_s: 0.1, force_n: 0.1}}
)");
  StepMany(engine.get(), 20);
  EXPECT_GT(engine->state().contacts.colliding_particles, 10);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);  // 3e-3 once
  const MomentumError error = MomentumBalance(engine->model(), engine->state());
  EXPECT_LE(error.linear, 1e-11);
  EXPECT_LE(error.angular, 1e-11);
}

// A particle that sticks to one fixed particle, and slides on the triangle beside it: all it can do
// is turn about the pin, and an impulse in line with that once grew to 1e86 kg m/s.
TEST(Sliding, BesideAPinStaysFinite) {
  auto engine = EngineOf(R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.03, subdivisions: 2}, mass_kg: 0.1}
  - {name: b, icosphere: {radius_m: 0.03}, mass_kg: 0.1, position_m: [0.0, 0, -0.063], fixed: [all: true]}
tools:
  - name: n
    needle: {radius_m: 0.003}
    position_m: [0.003, 0.002, 0.04]
    adhesion: {normal_strength_pa: 100}
    trajectory:
      - {t_s: 0, position_m: [0.003, 0.002, 0.04]}
      - {t_s: 0.3, position_m: [0.003, 0.002, -0.01]}
      - {t_s: 0.6, position_m: [0.06, 0.002, 0.06]}
effects:
  - shape_memory: {stiffness_n_m: 50}
  - volume_preservation: {}
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 10, friction_coefficient: 0.5}
)");
  EXPECT_FALSE(StepMany(engine.get(), 600) & kStepNonFinite);
  double fastest_m_s = 0;
  for (const Vec3& v : engine->state().velocity_m_s) fastest_m_s = std::max(fastest_m_s, v.norm());
  EXPECT_LT(fastest_m_s, 10);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

// Soft balls that quiver against each other: where elasticity turns a contact round within a
// sub-step, stopping it dead would book a gain (7 % of all that sliding took here).
TEST(Sliding, TakesNoEnergyFromForcesThatTurnItRound) {
  auto engine = EngineOf(R"(
bodies:
  - {name: heavy, icosphere: {radius_m: 0.0257, subdivisions: 1}, mass_kg: 1, position_m: [-0.052, -0.039, -0.0463], rotation_deg: [-40.2459, 115.1715, -155.2908], velocity_m_s: [0.0175, 0.41, 0.1615], angular_velocity_rad_s: [-1.411, 4.548, -1.0995]}
  - {name: light, icosphere: {radius_m: 0.0155, subdivisions: 1}, mass_kg: 0.01, position_m: [0.064, 0.0261, 0.0141], rotation_deg: [-70.9423, 78.9698, -52.9726], velocity_m_s: [-0.0079, -0.0705, -0.186], angular_velocity_rad_s: [9.1437, -6.0343, 3.869]}
effects:
  - shape_memory: {stiffness_n_m: 100, damping_n_s_m: 0.1}
  - volume_preservation: {}
  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: 2.04058}
  - drag: {rate_per_s: 0.76095}
  - virtual_adhesive: {capture_distance_m: 0.002, normal_strength_pa: 10, friction_coefficient: 0}
)");
  double sliding = 0, gained = 0;
  for (int step = 0; step < 850; ++step) {
    engine->Step({});
    gained += std::max(0.0, engine->state().ledger.sliding_j - sliding);
    sliding = engine->state().ledger.sliding_j;
  }
  EXPECT_LT(sliding, -1e-5);
  // What sweeps that have not converged leave.
  EXPECT_LT(gained, -1e-3 * sliding);
  EXPECT_EQ(MeasurePenetration(engine->model(), engine->state().position_m).vertices_inside, 0);
}

}  // namespace
}  // namespace adhesim::test
