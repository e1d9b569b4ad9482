#include <gtest/gtest.h>

#include <random>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

int EdgeBonds(const Engine& engine) {
  return static_cast<int>(std::ranges::count_if(
      engine.state().contacts.bonds, [](const Bond& bond) { return bond.partner >= 0; }));
}

std::string Numbers(const Vec3& v) {
  return "[" + std::to_string(v.x()) + ", " + std::to_string(v.y()) + ", " + std::to_string(v.z()) +
         "]";
}

// Spheres of 42 vertices have edges as long as 0.6 radii: thrown at each other at any angle and
// spinning, they meet with edges as often as with vertices.
TEST(EdgeContact, CoarseSpheresThrownAtEachOtherNeverInterlock) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
  int met = 0, by_edges = 0;
  for (int seed = 0; seed < (kSanitized ? 5 : TestSize(60, 1000)); ++seed) {
    const Vec3 direction = vector().normalized();
    const Vec3 aside = 0.6 * direction.cross(vector());
    std::string scene = "bodies:\n";
    for (const double side : {1.0, -1.0}) {
      scene += side > 0 ? "  - {name: a" : "  - {name: b";
      scene += ", icosphere: {radius_m: 0.6}, mass_kg: 1, rotation_deg: " + Numbers(180 * vector());
      scene += ", angular_velocity_rad_s: " + Numbers(5 * vector());
      scene += ", position_m: " + Numbers(side * (0.63 * direction + aside));
      scene += ", velocity_m_s: " + Numbers(-4 * side * direction) + "}\n";
    }
    auto engine = EngineOf(scene + R"(
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 1}
)");
    int edges = 0;
    for (int k = 0; k < 40; ++k) {
      StepMany(engine.get(), 10);
      edges = std::max(edges, EdgeBonds(*engine));
      const std::vector<Vec3>& x = engine->state().position_m;
      const Penetration now = MeasurePenetration(engine->model(), x);
      ASSERT_EQ(now.vertices_inside, 0)
          << "seed " << seed << " step " << 10 * k << " depth " << now.max_depth_m;
      ASSERT_EQ(CountEdgesThrough(engine->model(), x), 0) << "seed " << seed << " step " << 10 * k;
    }
    met += engine->state().contacts.next_zone_id > 0;
    by_edges += edges > 0;
    EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
  }
  // They pass each other in a quarter of the throws.
  EXPECT_GT(met, kSanitized ? 2 : 30);
  EXPECT_GT(by_edges, kSanitized ? 1 : 20);
}

}  // namespace
}  // namespace adhesim::test
