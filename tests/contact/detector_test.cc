#include "core/contact/detector.h"

#include <gtest/gtest.h>

#include <random>

#include "core/contact/penetration.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

constexpr const char* kThreeBodies = R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1}
  - {name: b, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1, position_m: [0.98, 0.1, 0.05]}
  - {name: plane, sheet: {length_m: 3, width_m: 3, columns: 12, rows: 12}, mass_kg: 1, position_m: [0, 0, -0.52]}
)";

TEST(ClosestPoint, IsNoFurtherThanAnyPointOfTheTriangle) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto point = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
  for (int trial = 0; trial < 2000; ++trial) {
    const Vec3 p = 2 * point(), a = point(), b = point(),
               c = trial % 10 == 0 ? Vec3(0.3 * a + 0.7 * b) : point();
    const ClosestPoint closest = ClosestPointOnTriangle(p, a, b, c);
    EXPECT_NEAR(closest.weights.sum(), 1, 1e-12);
    EXPECT_GE(closest.weights.minCoeff(), -1e-12);
    const Vec3 on = closest.weights(0) * a + closest.weights(1) * b + closest.weights(2) * c;
    EXPECT_NEAR((p - on).squaredNorm(), closest.distance_sq_m2, 1e-12);
    for (int i = 0; i <= 10; ++i) {
      for (int j = 0; i + j <= 10; ++j) {
        const Vec3 q = 0.1 * i * a + 0.1 * j * b + 0.1 * (10 - i - j) * c;
        EXPECT_GE((p - q).squaredNorm(), closest.distance_sq_m2 - 1e-12);
      }
    }
  }
}

// Every particle against every triangle of every other body.
std::vector<NearPair> BruteForce(const Model& model, const std::vector<Vec3>& x, double reach) {
  std::vector<NearPair> all;
  for (int p = 0; p < model.particle_count(); ++p) {
    for (int b = 0; b < static_cast<int>(model.bodies.size()); ++b) {
      if (model.body_of[p] == b) continue;
      const Body& body = model.bodies[b];
      NearPair best{p, b, -1, Vec3::Zero(), Vec3::Zero(), reach * reach, 1};
      for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
        const Triangle& tri = model.triangles[t];
        const ClosestPoint point = ClosestPointOnTriangle(x[p], x[tri[0]], x[tri[1]], x[tri[2]]);
        if (point.distance_sq_m2 < best.gap_m) {
          best.gap_m = point.distance_sq_m2;
          best.triangle = t;
        }
      }
      if (best.triangle >= 0) all.push_back(best);
    }
  }
  return all;
}

TEST(Detector, FindsWhatBruteForceFindsWhileEverythingMoves) {
  const auto model = ModelOf(kThreeBodies);
  const double reach = 0.08;
  Detector detector(*model, reach);
  Parallel one(1), two(2);
  std::vector<Vec3> x = model->rest_position_m;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int found = 0;
  for (int step = 0; step < 60; ++step) {
    for (Vec3& p : x)
      p += 0.004 * Vec3(uniform(random), uniform(random), uniform(random)) + Vec3(0.002, 0, 0);
    StepReport report;
    detector.Update(x, &one, &report);
    EXPECT_EQ(report.bits, 0u);
    const std::span<const NearPair> span = detector.Find(x, step % 2 ? &one : &two);
    const std::vector<NearPair> near(span.begin(), span.end());
    const std::vector<NearPair> expected = BruteForce(*model, x, reach);
    ASSERT_EQ(near.size(), expected.size());
    for (std::size_t k = 0; k < near.size(); ++k) {
      EXPECT_EQ(near[k].particle, expected[k].particle);
      EXPECT_EQ(near[k].body, expected[k].body);
      EXPECT_EQ(near[k].triangle, expected[k].triangle);
      EXPECT_NEAR(near[k].gap_m * near[k].gap_m, expected[k].gap_m, 1e-14);
    }
    found += static_cast<int>(near.size());
  }
  EXPECT_GT(found, 500);
}

TEST(Detector, TellsInsideFromOutsideAtFacesEdgesAndCorners) {
  // A block: its edges and corners are where the nearest face's own normal gives wrong signs.
  const auto model = ModelOf(R"(
bodies:
  - {name: block, block: {size_m: [1, 1, 1], cells: 2}, mass_kg: 1}
  - {name: probe, sheet: {length_m: 0.01, width_m: 0.01, columns: 2, rows: 2}, mass_kg: 1, position_m: [5, 0, 0]}
)");
  const int probe = model->bodies[1].first_particle;
  std::mt19937 random(9);
  std::uniform_real_distribution<double> uniform(-0.7, 0.7);
  Parallel one(1);
  int inside_count = 0, outside_count = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<Vec3> x = model->rest_position_m;
    const Vec3 p(uniform(random), uniform(random), uniform(random));
    for (int k = 0; k < 4; ++k) x[probe + k] = k == 0 ? p : Vec3(p + Vec3(10, 10, 10));
    Detector detector(*model, 0.3);
    StepReport report;
    detector.Update(x, &one, &report);
    const bool inside = p.cwiseAbs().maxCoeff() < 0.5;
    for (const NearPair& pair : detector.Find(x, &one)) {
      if (pair.particle != probe) continue;
      EXPECT_EQ(pair.gap_m < 0, inside) << p.transpose();
      ++(inside ? inside_count : outside_count);
    }
  }
  EXPECT_GT(inside_count, 200);
  EXPECT_GT(outside_count, 200);
}

TEST(Penetration, OfOverlappingSpheresIsTheirOverlap) {
  const auto model = ModelOf(R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.5, subdivisions: 3}, mass_kg: 1}
  - {name: b, icosphere: {radius_m: 0.5, subdivisions: 3}, mass_kg: 1, position_m: [0.9, 0, 0]}
)");
  const Penetration deep = MeasurePenetration(*model, model->rest_position_m);
  EXPECT_NEAR(deep.max_depth_m, 0.1,
              0.01);  // facets of a 642-vertex sphere are within 1 % of its radius
  EXPECT_GT(deep.vertices_inside, 10);
  std::vector<Vec3> apart = model->rest_position_m;
  for (int p = model->bodies[1].first_particle; p < model->particle_count(); ++p)
    apart[p].x() += 0.2;
  EXPECT_EQ(MeasurePenetration(*model, apart).vertices_inside, 0);
}

}  // namespace
}  // namespace adhesim::test
