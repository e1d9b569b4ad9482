#include <set>

#include "tests/support/test_size.h"
#include "tests/tissue/tissue_sample.h"

// Rigid indenters pressed into a half space: Hertz and flat punches, through contact.
//
// The block is 8 contact radii wide and 4 deep. A block of that size would be some tens of per cent
// too stiff or too soft; instead its bottom and sides are held where a half space under the same
// force has them: at Boussinesq's displacements of a point force (Johnson, Contact Mechanics, 1985,
// eq. 3.18). These differ from those of the true pressure by (a / 4 a)^2 of what is there, itself a
// tenth of the depth: less than 1 per cent of the depth.
//
// Contact sticks under pressure (zones), so the closed forms are those without slip: stiffer than
// without friction by (1 - nu) ln(3 - 4 nu) / (1 - 2 nu) (Spence 1968), 1.003 at nu = 0.45.
namespace adhesim::test {
namespace {

constexpr double kWidth_m = 0.1, kRadius_m = kWidth_m / 8;  // a, the contact radius aimed at
constexpr double kPoisson = 0.45, kYoung_pa = 5000;
constexpr double kPlaneModulus_pa = kYoung_pa / (1 - kPoisson * kPoisson);  // E*: rigid indenter

// Displacement of a half space's point (z < 0: inside) under a force down at the origin.
Vec3 Boussinesq(const Vec3& x, double force_n) {
  const double shear_pa = kYoung_pa / (2 * (1 + kPoisson));
  const double z = -x.z(), away = x.norm(), r = x.head<2>().norm();
  const double scale = force_n / (4 * M_PI * shear_pa * away);
  const double outward = scale * (r * z / (away * away) - (1 - 2 * kPoisson) * r / (away + z));
  const double down = scale * (z * z / (away * away) + 2 * (1 - kPoisson));
  const Eigen::Vector2d radial = r > 0 ? Eigen::Vector2d(x.head<2>() / r) : Eigen::Vector2d::Zero();
  return {outward * radial.x(), outward * radial.y(), -down};
}

// A block whose top is the plane z = 0, and above it a rigid sheet which is given the indenter's
// shape.
struct Indentation {
  int cells;       // of the block, across
  double force_n;  // the sheet's weight
  double capture_m;
  int sheet_cells;
  double sheet_m;  // its width
  double (*height_m)(double x, double y);

  std::shared_ptr<Model> Make() const {
    TissueSample sample;
    sample.size_m = {kWidth_m, kWidth_m, kWidth_m / 2};
    sample.cells = cells;
    sample.poisson_ratio = kPoisson;
    sample.young_modulus_pa = kYoung_pa;
    sample.dt_s = 0.005;
    sample.tolerance = 1e-3;
    const std::string side = std::to_string(kWidth_m / 2 - 1e-5);
    sample.fixed = "[half_space: {point_m: [0, 0, " + std::to_string(-kWidth_m / 4 + 1e-5) +
                   "], normal: [0, 0, 1]}, half_space: {point_m: [-" + side +
                   ", 0, 0], normal: [1, 0, 0]}, half_space: {point_m: [" + side +
                   ", 0, 0], normal: [-1, 0, 0]}, half_space: {point_m: [0, -" + side +
                   ", 0], normal: [0, 1, 0]}, half_space: {point_m: [0, " + side +
                   ", 0], normal: [0, -1, 0]}]";
    const std::string width = std::to_string(sheet_m), count = std::to_string(sheet_cells + 1);
    sample.bodies_and_tools = "  - {name: indenter, kind: rigid, sheet: {length_m: " + width +
                              ", width_m: " + width + ", columns: " + count + ", rows: " + count +
                              "}, mass_kg: " + std::to_string(force_n) + "}\n";
    sample.effects =
        "  - uniform_gravity: {bodies: [indenter], acceleration_m_s2: [0, 0, -1]}\n"
        "  - drag: {rate_per_s: 30}\n"
        "  - virtual_adhesive: {capture_distance_m: " +
        std::to_string(capture_m) + ", normal_strength_pa: 0}\n";
    const std::shared_ptr<Model> model = sample.Make();
    for (std::size_t p = 0; p < model->rest_position_m.size(); ++p) {
      Vec3& x = model->rest_position_m[p];
      if (model->body_of[p] == 0) {
        x.z() -= kWidth_m / 4;
      } else {
        x.z() = height_m(x.x(), x.y()) + 0.9 * capture_m;
      }
    }
    return model;
  }
  // Depth at rest of the block's point below the indenter's middle.
  double Depth(double seconds) const {
    const auto engine = EngineOf(Make());
    const Model& model = engine->model();
    State start = engine->state();
    int middle = 0;
    for (std::size_t p = 0; p < start.position_m.size(); ++p) {
      Vec3& x = start.position_m[p];
      if (model.fixed[p]) x += Boussinesq(x, force_n);
      if (model.body_of[p] == 0 && x.norm() < start.position_m[middle].norm()) middle = p;
    }
    engine->Restore(start);
    const auto depth = [&] {
      return model.rest_position_m[middle].z() - engine->state().position_m[middle].z();
    };
    std::uint32_t bits = 0;
    double before = 0;
    for (int step = 0; step * model.dt_s < seconds; ++step) {
      before = depth();
      bits |= engine->Step({}).bits;
    }
    Tell("  bits", bits);
    Tell("  substeps' last move over depth", (depth() - before) / depth());
    std::set<int> members;
    double radius = 0;
    for (const Bond& bond : engine->state().contacts.bonds) {
      bond.ForEachMember([&](int p) {
        if (model.body_of[p] == 0 && members.insert(p).second) {
          radius = std::max(radius, model.rest_position_m[p].head<2>().norm());
        }
      });
    }
    Tell("  particles in contact", members.size());
    Tell("  furthest over a", radius / kRadius_m);
    Tell("  zones", engine->state().contacts.zones.size());
    const Frame frame = engine->MakeFrame();
    double carried_n = 0;
    for (const ContactFrame& contact : frame.contacts) carried_n += contact.normal_force_n;
    Tell("  carried over force", carried_n / force_n);
    return depth();
  }
};

// Hertz: F = 4/3 E* sqrt(R) d^(3/2), a^2 = R d.
TEST(Indentation, OfAParaboloidFollowsHertz) {
  constexpr double kR_m = 10 * kRadius_m;
  const double depth_m = kRadius_m * kRadius_m / kR_m;
  const double force_n = 4.0 / 3 * kPlaneModulus_pa * std::sqrt(kR_m) * std::pow(depth_m, 1.5);
  for (int cells : {16, 24, 32}) {
    const Indentation indentation{
        cells, force_n,       depth_m / 50,
        40,    4 * kRadius_m, [](double x, double y) { return (x * x + y * y) / (2 * kR_m); }};
    const double depth = indentation.Depth(0.8);
    Tell("Hertz: force over closed form, cells " + std::to_string(cells),
         std::pow(depth_m / depth, 1.5));
  }
}

// A square punch of side 2 b, whose edges lie on the lattice: F = 1.0124 (2 / sqrt(pi)) E* sqrt(A)
// d (King 1987); a circular one of the same area is 2 E* a d.
TEST(Indentation, OfAFlatSquarePunchFollowsItsClosedForm) {
  const double side_m = 2 * kRadius_m, depth_m = kRadius_m / 20;
  const double force_n = 1.0124 * 2 / std::sqrt(M_PI) * kPlaneModulus_pa * side_m * depth_m;
  for (int cells : {16, 24, 32}) {
    const Indentation indentation{cells,     force_n, depth_m / 50,
                                  cells / 4, side_m,  [](double, double) { return 0.0; }};
    const double depth = indentation.Depth(0.8);
    Tell("square punch: force over closed form, cells " + std::to_string(cells), depth_m / depth);
  }
}

}  // namespace
}  // namespace adhesim::test
