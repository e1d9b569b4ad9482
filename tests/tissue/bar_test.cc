#include "tests/tissue/tissue_sample.h"

// Bars under tension, whose stress is uniform or linear: the constants of the laws are those that
// they are called.
namespace adhesim::test {
namespace {

// A bar that hangs by its upper end. Lengths of the cells are a quarter of the bar's width at
// `cells` 16.
struct HangingBar {
  static constexpr double kLength_m = 0.4;
  static constexpr double kGravity_m_s2 = 1e-4;  // strains of 1e-5: the laws are linear
  TissueSample sample;

  HangingBar(int cells, double poisson_ratio) {
    sample.size_m = {0.1, 0.1, kLength_m};
    sample.cells = cells;
    sample.poisson_ratio = poisson_ratio;
    sample.dt_s = kStaticStep_s;
    sample.fixed = "[half_space: {point_m: [0, 0, 0.1999], normal: [0, 0, -1]}]";
    sample.effects = "  - uniform_gravity: {acceleration_m_s2: [0, 0, -1e-4]}\n";
  }
  double slope() const {  // rho g / E
    return sample.density_kg_m3 * kGravity_m_s2 / sample.young_modulus_pa;
  }
  // Displacement of a point of the bar under its own weight, where its upper end is free to become
  // narrower (Timoshenko, Goodier, Theory of Elasticity, 3rd ed. 1970, article 96).
  Vec3 Exact(const Vec3& x) const {
    const double z = x.z() + kLength_m / 2, nu = sample.poisson_ratio;
    return slope() * Vec3(-nu * x.x() * z, -nu * x.y() * z,
                          (z * z - kLength_m * kLength_m + nu * x.head<2>().squaredNorm()) / 2);
  }
};

// The mean displacement of the free end is the work of a unit traction there. Without lateral
// contraction that traction alone makes a linear displacement, which tetrahedra represent: Galerkin
// makes the mean exact on every mesh. What is left is the square of the strains, 1e-10.
TEST(HangingBar, LengthensByRhoGLSquaredOverTwoEOnEveryMesh) {
  for (int cells : {4, 8, 16}) {
    const HangingBar bar(cells, 0);
    const auto engine = EngineOf(bar.sample.Make());
    Settle(engine.get());
    const double half = HangingBar::kLength_m / 2;
    const double end_m = MeanDisplacement(*engine, FaceAreas(engine->model(), 2, -half), 2);
    const double exact_m = -bar.slope() * HangingBar::kLength_m * HangingBar::kLength_m / 2;
    Tell("hanging bar, nu 0, relative error " + std::to_string(cells), end_m / exact_m - 1);
    EXPECT_NEAR(end_m / exact_m, 1, 1e-8);
  }
}

// With lateral contraction, and the upper end held as it is in the closed form: every particle
// converges to it with the square of the cells' size, as linear elements do where displacements are
// smooth.
TEST(HangingBar, ConvergesToItsDisplacementsWithTheSquareOfH) {
  std::vector<double> h, error;
  for (int cells : {4, 8, 16}) {
    const HangingBar bar(cells, 0.45);
    const auto engine = EngineOf(bar.sample.Make());
    State start = engine->state();
    for (std::size_t p = 0; p < start.position_m.size(); ++p) {
      if (engine->model().fixed[p]) start.position_m[p] += bar.Exact(start.position_m[p]);
    }
    engine->Restore(start);
    Settle(engine.get());
    double sum = 0, all = 0;
    for (int p = 0; p < engine->model().particle_count(); ++p) {
      const Vec3& x = engine->model().rest_position_m[p];
      const double mass = engine->model().mass_kg[p];
      sum += mass * (engine->state().position_m[p] - x - bar.Exact(x)).squaredNorm();
      all += mass * bar.Exact(x).squaredNorm();
    }
    h.push_back(HangingBar::kLength_m / cells);
    error.push_back(std::sqrt(sum / all));
    Tell("hanging bar, nu 0.45, error, cells " + std::to_string(cells), error.back());
  }
  const double order = FittedOrder(h, error);
  Tell("hanging bar, nu 0.45, fitted order", order);
  // Two, but for the coarsest mesh of one cell across.
  EXPECT_GT(order, 1.7);
  EXPECT_LT(order, 2.3);
  EXPECT_LT(error.back(), 0.01);
}

// Nominal stress and lateral stretch of a bar that is free at its sides, at this stretch.
struct Uniaxial {
  double stress_pa, lateral;
};

// Corotational: linear in the stretch, with Hooke's constants.
Uniaxial CorotationalBar(double young_pa, double nu, double stretch) {
  return {young_pa * (stretch - 1), 1 - nu * (stretch - 1)};
}

// P = mu (F - F^-T) + lambda ln J F^-T. The lateral stretch t is where mu (t - 1/t) + lambda ln(l
// t^2) / t vanishes: the left side times t grows with t, so bisection finds it.
Uniaxial NeoHookeanBar(double young_pa, double nu, double stretch) {
  const double mu = young_pa / (2 * (1 + nu));
  const double lambda = young_pa * nu / ((1 + nu) * (1 - 2 * nu));
  double low = 0.1, high = 10;
  for (int k = 0; k < 200; ++k) {
    const double t = 0.5 * (low + high);
    (mu * (t * t - 1) + lambda * std::log(stretch * t * t) > 0 ? high : low) = t;
  }
  return {mu * (stretch - 1 / stretch) + lambda * std::log(stretch * low * low) / stretch, low};
}

// Both ends are held as the closed form has them; the implicit step finds what is between, whose
// sides are free, and the ends carry the closed form's force. Uniform strain is in the space of the
// elements: nothing is left but the solver's tolerance.
void ExpectUniaxial(const std::string& law, double stretch, const Uniaxial& exact) {
  TissueSample sample;
  sample.size_m = {0.2, 0.1, 0.1};
  sample.cells = 6;
  sample.poisson_ratio = 0.45;
  sample.law = law;
  sample.dt_s = kStaticStep_s;
  sample.integrator = Integrator::kNewton;
  sample.tolerance = 1e-10;
  sample.fixed =
      "[half_space: {point_m: [-0.0999, 0, 0], normal: [1, 0, 0]}, half_space: {point_m: [0.0999, "
      "0, 0], normal: [-1, 0, 0]}]";
  const auto engine = EngineOf(sample.Make());
  const Vec3 stretches(stretch, exact.lateral, exact.lateral);
  State start = engine->state();
  for (std::size_t p = 0; p < start.position_m.size(); ++p) {
    Vec3& x = start.position_m[p];
    // In between, the start is wrong by a bulge.
    const double bulge = 0.1 * (1 - std::pow(x.x() / 0.1, 2));
    x = stretches.cwiseProduct(x) + bulge * Vec3(0.1 * x.y(), x.y(), x.z());
  }
  engine->Restore(start);
  Settle(engine.get());
  const std::vector<Vec3> force = ElasticForces(*engine);
  double pull_n = 0, error = 0;
  for (int p = 0; p < engine->model().particle_count(); ++p) {
    const Vec3& x = engine->model().rest_position_m[p];
    error = std::max(error, (engine->state().position_m[p] - stretches.cwiseProduct(x)).norm());
    if (x.x() > 0.0999) pull_n -= force[p].x();
  }
  const double exact_n = exact.stress_pa * 0.1 * 0.1;
  Tell(law + " bar, force over closed form at " + std::to_string(stretch), pull_n / exact_n);
  EXPECT_NEAR(pull_n / exact_n, 1, 1e-7);
  EXPECT_LE(error, 1e-8 * 0.2);
}

TEST(UniaxialBar, OfCorotationalTissuePullsWithEAEps) {
  for (double stretch : {0.8, 0.999, 1.001, 1.2, 1.5}) {
    ExpectUniaxial("corotational", stretch, CorotationalBar(5000, 0.45, stretch));
  }
}

TEST(UniaxialBar, OfNeoHookeanTissueFollowsItsClosedForm) {
  for (double stretch : {0.6, 0.8, 0.999, 1.001, 1.2, 1.5, 1.8}) {
    ExpectUniaxial("neo_hookean", stretch, NeoHookeanBar(5000, 0.45, stretch));
  }
}

}  // namespace
}  // namespace adhesim::test
