#include "tests/support/test_size.h"
#include "tests/tissue/tissue_sample.h"

// The work of adhesion: a sphere pulled off tissue against Johnson, Kendall and Roberts.
namespace adhesim::test {
namespace {

// A sphere of radius R that sticks to a half space with the work of adhesion w. Everything is set
// by a_0, the radius of contact at no force; a_0 / R = 1/5 keeps strains small.
constexpr double kRadius_m = 0.05, kContact_m = 0.01;  // R, a_0
constexpr double kPoisson = 0.45, kYoung_pa = 5000;
constexpr double kPlaneModulus_pa = kYoung_pa / (1 - kPoisson * kPoisson);  // E*: a rigid sphere
// a_0 = (9 pi w R^2 / (2 E*))^(1/3).
constexpr double kWork_j_m2 = 2 * kPlaneModulus_pa * kContact_m * kContact_m * kContact_m /
                              (9 * M_PI * kRadius_m * kRadius_m);
constexpr double kPullOff_n = 1.5 * M_PI * kWork_j_m2 * kRadius_m;

struct PullOff {
  int cells;  // of the block, across its 5 a_0
  std::string adhesive;
  double work_j_m2 = kWork_j_m2;
  bool flat = false;  // a plate instead of the sphere, and the block's boundary moves as one

  // d_on: 5 per cent of what the sphere's surface rises over the contact.
  static constexpr double capture_m = 4e-5;

  double h_m() const { return 5 * kContact_m / cells; }

  // A block whose top is z = 0, and the sphere's lowest part as a fixed sheet whose particles are
  // above the block's.
  std::shared_ptr<Model> Make() const {
    const double width_m = 5 * kContact_m;
    TissueSample sample;
    sample.size_m = {width_m, width_m, width_m / 2};
    sample.cells = cells;
    sample.poisson_ratio = kPoisson;
    sample.young_modulus_pa = kYoung_pa;
    sample.dt_s = kStaticStep_s;
    sample.tolerance = 1e-3;
    const std::string side = std::to_string(width_m / 2 - 1e-5);
    sample.fixed = "[half_space: {point_m: [0, 0, " + std::to_string(-width_m / 4 + 1e-5) +
                   "], normal: [0, 0, 1]}, half_space: {point_m: [-" + side +
                   ", 0, 0], normal: [1, 0, 0]}, half_space: {point_m: [" + side +
                   ", 0, 0], normal: [-1, 0, 0]}, half_space: {point_m: [0, -" + side +
                   ", 0], normal: [0, 1, 0]}, half_space: {point_m: [0, " + side +
                   ", 0], normal: [0, -1, 0]}]";
    const std::string width = std::to_string(0.6 * width_m),
                      count = std::to_string(3 * cells / 5 + 1);
    sample.bodies_and_tools = "  - {name: sphere, sheet: {length_m: " + width +
                              ", width_m: " + width + ", columns: " + count + ", rows: " + count +
                              "}, mass_kg: 1, fixed: [all: true]}\n";
    sample.effects = "  - virtual_adhesive: {capture_distance_m: " + std::to_string(capture_m) +
                     ", work_of_adhesion_j_m2: " + std::to_string(work_j_m2) + adhesive + "}\n";
    const std::shared_ptr<Model> model = sample.Make();
    for (std::size_t p = 0; p < model->rest_position_m.size(); ++p) {
      Vec3& x = model->rest_position_m[p];
      if (model->body_of[p] == 0) {
        x.z() -= width_m / 4;
      } else {
        x.z() = flat ? 0 : x.head<2>().squaredNorm() / (2 * kRadius_m);
      }
      x += Offset();
    }
    return model;
  }
  // Particles are in the middle of patches, not on their borders.
  Vec3 Offset() const { return Vec3::Constant(0.3 * h_m()); }

  static double Force(const Engine& engine, Frame* frame) {
    engine.WriteFrame(frame);
    double force_n = 0;  // of the block on the sphere
    for (const ContactForce& contact : frame->contact_forces) force_n -= contact.force_n[2];
    return force_n;
  }

  // The greatest pull while the block, pressed to 0.8 a_0, is lowered until nothing sticks.
  double Strongest() const {
    const auto engine = EngineOf(Make());
    const Model& model = engine->model();
    Frame frame = engine->MakeFrame();
    State state = engine->state();
    double depth_m = flat ? 0 : 0.64 * kContact_m * kContact_m / kRadius_m;  // Hertz's: a^2 / R
    double force_n = 4.0 / 3 * kPlaneModulus_pa * std::sqrt(kRadius_m) * std::pow(depth_m, 1.5);
    // The block raised by the depth, its far boundary held where a half space under the force has
    // it.
    const auto hold = [&] {
      for (std::size_t p = 0; p < state.position_m.size(); ++p) {
        if (model.body_of[p] != 0 || !model.fixed[p]) continue;
        const Vec3 rest = model.rest_position_m[p];
        state.position_m[p] =
            rest + Boussinesq(rest - Offset(), force_n, kYoung_pa, kPoisson) + Vec3(0, 0, depth_m);
      }
      engine->Restore(state);
    };
    // To begin with, the top has Hertz's shape, and what is below follows it.
    const double a_m = std::sqrt(kRadius_m * depth_m);
    const auto sunk_m = [&](double r) {
      if (flat) return 0.0;
      if (r < a_m) return depth_m - r * r / (2 * kRadius_m);
      const double q = r / a_m;
      return depth_m / M_PI * ((2 - q * q) * std::asin(1 / q) + std::sqrt(q * q - 1));
    };
    for (std::size_t p = 0; p < state.position_m.size(); ++p) {
      if (model.body_of[p] != 0 || model.fixed[p]) continue;
      const Vec3 x = model.rest_position_m[p] - Offset();
      state.position_m[p].z() += depth_m - (sunk_m(x.head<2>().norm()) + 0.5 * capture_m) *
                                               (1 + x.z() / (2.5 * kContact_m));
      // So slow that it counts as approach, and as nothing else.
      state.velocity_m_s[p].z() = 1e-3 * capture_m / model.dt_s;
    }
    hold();
    double most_n = 0;
    for (int step = 0; step < 400; ++step) {
      engine->Step({});
      const double now_n = Force(*engine, &frame);
      // Part of the change only: the boundary answers almost as stiffly as the sphere.
      if (!flat) force_n += 0.4 * (now_n - force_n);
      state = engine->state();
      if (step > 8) most_n = std::max(most_n, -now_n);
      if (state.contacts.bonds.empty()) break;
      if (step >= 8) depth_m -= flat || depth_m > 2e-4 ? 4e-5 : 1e-5;
      hold();
    }
    EXPECT_TRUE(engine->state().contacts.bonds.empty());
    return most_n;
  }
};

// A flat contact that lets go in patches carries what the lesser of strength and crack traction
// gives: with a high strength the square root of the work, with a great work the strength alone.
// Steps of 40 um leave 2 to 3 per cent of the force.
TEST(WorkOfAdhesion, OfAFlatPatchTakesTheLesserOfStrengthAndCrackTraction) {
  const auto force = [](double work_j_m2, const char* strength_pa) {
    PullOff pull{10, std::string(", patch_size_m: 10, normal_strength_pa: ") + strength_pa};
    pull.flat = true;
    pull.work_j_m2 = work_j_m2;
    return pull.Strongest();
  };
  const double crack_n = force(kWork_j_m2, "1e9");
  Tell("flat patch: crack's force, N", crack_n);
  const double twice = force(4 * kWork_j_m2, "1e9") / crack_n;
  Tell("flat patch: force with four times the work", twice);
  EXPECT_NEAR(twice, 2, 0.1);
  const double strength_n = force(1e4, "500");
  Tell("flat patch: strength's force, N", strength_n);
  const double both = force(1e4, "1000") / strength_n;
  Tell("flat patch: force with twice the strength", both);
  EXPECT_NEAR(both, 2, 0.1);
  // On the fixed sheet the block is one patch: the traction is that over the whole.
  const double area_m2 = strength_n / 500, size_m = std::sqrt(area_m2);
  const double traction_pa = std::sqrt(4 * kPlaneModulus_pa * kWork_j_m2 / (M_PI * size_m));
  EXPECT_NEAR(crack_n / (traction_pa * area_m2), 1, 0.05);
}

// What holds as one zone lets go particle by particle. The sphere is rigid, so that the zone
// hinders nothing that the sphere does not. Measured on cells of a_0 / 2, a_0 / 4 and (full size)
// a_0 / 8: 2.32, 1.63 and 0.86 of JKR. The front of the crack is a staircase of particles, and on
// coarse meshes each holds longer than a smooth front would. Nearer to JKR on every finer mesh is
// what is claimed; the values cross it, and where they end three meshes cannot tell.
TEST(WorkOfAdhesion, OfASphereComesNearerToJohnsonKendallAndRobertsOnFinerMeshes) {
  if (kSanitized) GTEST_SKIP() << "long; shorter runs of the same are in tests/engine";
  double away = 1.6;
  for (int cells = 10; cells <= TestSize(20, 40); cells *= 2) {
    const double over = PullOff{cells, ""}.Strongest() / kPullOff_n;
    Tell("mode R: pull-off over JKR, cells in a_0: " + std::to_string(cells / 5), over);
    EXPECT_LT(std::abs(over - 1), away);
    away = std::abs(over - 1);
  }
  EXPECT_LT(away, 0.75);  // measured on a_0 / 4: 0.63
}

// Patches of a cell peel as well. Measured on cells of a_0 / 2, a_0 / 4 and (full size) a_0 / 8:
// 2.01, 1.21 and 0.86 of JKR: on coarse meshes below what particles carry as one zone, since
// corners that a patch only touches are not held.
TEST(WorkOfAdhesion, PatchesOfACellComeNearerToJohnsonKendallAndRobertsThanParticles) {
  if (kSanitized) GTEST_SKIP() << "long; shorter runs of the same are in tests/engine";
  double away = 1.3;
  for (int cells = 10; cells <= TestSize(20, 40); cells *= 2) {
    PullOff pull{cells, ""};
    pull.adhesive = ", patch_size_m: " + std::to_string(pull.h_m());
    const double over = pull.Strongest() / kPullOff_n;
    Tell("mode P: pull-off over JKR, cells in a_0: " + std::to_string(cells / 5), over);
    EXPECT_LT(std::abs(over - 1), away);
    away = std::abs(over - 1);
  }
  EXPECT_LT(away, 0.35);  // measured on a_0 / 4: 0.21
}

}  // namespace
}  // namespace adhesim::test
