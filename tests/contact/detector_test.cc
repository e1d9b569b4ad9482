#include "core/contact/detector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
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

void ExpectBruteForcesPairs(Detector* detector, const Model& model, const std::vector<Vec3>& x,
                            std::size_t* found) {
  Parallel one(1);
  StepReport report;
  detector->Update(x, &one, &report);
  const std::span<const NearPair> near = detector->Find(x, &one);
  const std::vector<NearPair> expected = BruteForce(model, x, detector->reach_m());
  EXPECT_EQ(report.bits, 0u);
  ASSERT_EQ(near.size(), expected.size());
  for (std::size_t k = 0; k < near.size(); ++k) {
    EXPECT_EQ(near[k].particle, expected[k].particle);
    EXPECT_EQ(near[k].body, expected[k].body);
    // Round-off of squared distances of up to a metre.
    EXPECT_NEAR(near[k].gap_m * near[k].gap_m, expected[k].gap_m, 1e-14);
  }
  *found += near.size();
}

// Far from the shape that its tree was built for.
TEST(Detector, FindsWhatBruteForceFindsWhileASheetIsRolledUp) {
  const auto model = ModelOf(R"(
bodies:
  - {name: sheet, sheet: {length_m: 2, width_m: 0.5, columns: 33, rows: 9}, mass_kg: 1}
  - {name: ball, icosphere: {radius_m: 0.1, subdivisions: 2}, mass_kg: 1, position_m: [0, 0.05, 0.12]}
)");
  Detector detector(*model, 0.03);
  std::vector<Vec3> x = model->rest_position_m;
  std::size_t found = 0;
  for (int step = 0; step <= 40; ++step) {
    // A spiral about the ball: arc length is kept nearly, the radius grows from 0.12 m.
    const double turns_m = 0.1 * step / 40 / 0.12;  // how much of the way it is rolled
    for (int p = 0; p < model->bodies[1].first_particle; ++p) {
      const Vec3& rest = model->rest_position_m[p];
      const double along = rest.x() + 1, angle = turns_m * 10 * along, radius = 0.12 + 0.01 * angle;
      const Vec3 rolled(radius * std::sin(angle), rest.y(), 0.12 - radius * std::cos(angle));
      const double share = step / 40.0;
      x[p] = (1 - share) * rest + share * rolled;
    }
    ExpectBruteForcesPairs(&detector, *model, x, &found);
  }
  EXPECT_GT(found, 100u);
}

TEST(Detector, FindsWhatBruteForceFindsWhileABodyIsStretchedTenfold) {
  const auto model = ModelOf(kThreeBodies);
  Detector detector(*model, 0.08);
  std::vector<Vec3> x = model->rest_position_m;
  std::size_t found = 0;
  for (int step = 0; step <= 30; ++step) {
    const double factor = std::pow(10, step / 30.0);
    for (int p = 0; p < model->bodies[1].first_particle; ++p) {
      const Vec3& rest = model->rest_position_m[p];
      x[p] = Vec3(rest.x(), factor * rest.y(), rest.z());
    }
    ExpectBruteForcesPairs(&detector, *model, x, &found);
  }
  EXPECT_GT(found, 500u);
}

// Mesh edges between two particles, at most `most`.
bool WithinEdges(const Model& model, int from, int to, int most) {
  if (from == to) return true;
  for (int k = model.neighbour_start[from]; most > 0 && k < model.neighbour_start[from + 1]; ++k) {
    if (WithinEdges(model, model.neighbours[k], to, most - 1)) return true;
  }
  return false;
}

TEST(Detector, FindsABodysOwnParticlesAndEdgesWhereTheyMayCollide) {
  const auto model = ModelOf(R"(
bodies:
  - {name: sheet, sheet: {length_m: 1, width_m: 1, columns: 7, rows: 7}, mass_kg: 1}
)");
  const double reach = 0.05, apart = 0.45;  // at rest further than two edges of 0.17 m
  Detector detector(*model, reach, {.edges = true, .self_apart_m = apart});
  Parallel one(1);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.4, 0.4);
  const std::vector<Vec3>& rest = model->rest_position_m;
  int found = 0, edges = 0;
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Vec3> x = rest;  // crumpled
    for (Vec3& p : x) p = Vec3(uniform(random), uniform(random), uniform(random));
    StepReport report;
    detector.Update(x, &one, &report);
    std::map<int, double> expected;  // distance of each particle that has a triangle in reach
    for (int p = 0; p < model->particle_count(); ++p) {
      double nearest_sq = reach * reach;
      for (const Triangle& tri : model->triangles) {
        const bool together =
            std::ranges::any_of(tri, [&](int v) { return WithinEdges(*model, p, v, 2); }) ||
            ClosestPointOnTriangle(rest[p], rest[tri[0]], rest[tri[1]], rest[tri[2]])
                    .distance_sq_m2 < apart * apart;
        const double d =
            ClosestPointOnTriangle(x[p], x[tri[0]], x[tri[1]], x[tri[2]]).distance_sq_m2;
        if (together || d >= nearest_sq) continue;
        expected[p] = std::sqrt(nearest_sq = d);
      }
    }
    const auto near = detector.Find(x, &one);
    ASSERT_EQ(near.size(), expected.size());
    for (const NearPair& pair : near) EXPECT_NEAR(pair.gap_m, expected.at(pair.particle), 1e-12);
    found += static_cast<int>(near.size());
    for (const NearEdges& pair : detector.FindEdges(x, {}, &one, &report)) {
      ++edges;
      for (int p : pair.ends) {
        for (int k = 0; k < 3; ++k) {
          const int v = model->triangles[pair.triangle][k];
          if (pair.weights(k) > 0) {
            EXPECT_FALSE(WithinEdges(*model, p, v, 2));
          }
        }
      }
    }
    EXPECT_EQ(report.bits, 0u);
  }
  EXPECT_GT(found, 50);
  EXPECT_GT(edges, 10);
}

TEST(Detector, LeavesOutThoseEdgesThatMoveAsOneAndNoOthers) {
  const auto model = ModelOf(R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.5, subdivisions: 1}, mass_kg: 1}
  - {name: b, icosphere: {radius_m: 0.5, subdivisions: 1}, mass_kg: 1, position_m: [0.9, 0.1, 0.05]}
)");
  Detector detector(*model, 0.2, {.edges = true, .self_apart_m = std::nullopt});
  Parallel one(1);
  std::vector<Vec3> x = model->rest_position_m;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-0.02, 0.02);
  using Ends = std::array<int, 4>;
  const auto ends_of = [&](const NearEdges& pair) {
    std::vector<int> other;
    for (int k = 0; k < 3; ++k) {
      if (pair.weights(k) > 0) other.push_back(model->triangles[pair.triangle][k]);
    }
    return Ends{pair.ends[0], pair.ends[1], other.at(0), other.at(1)};
  };
  int left_out = 0, kept = 0;
  for (int step = 0; step < 100; ++step) {
    for (Vec3& p : x) p += Vec3(uniform(random), uniform(random), uniform(random));
    std::vector<std::int32_t> moves_with(x.size());
    for (auto& zone : moves_with) zone = static_cast<int>(random() % 4 > 0) - 1;  // a quarter: -1
    StepReport report;
    detector.Update(x, &one, &report);
    std::vector<Ends> expected, found;
    for (const NearEdges& pair : detector.FindEdges(x, {}, &one, &report)) {
      const Ends ends = ends_of(pair);
      const bool as_one = std::ranges::all_of(ends, [&](int p) { return moves_with[p] == 0; });
      as_one ? void(++left_out) : expected.push_back(ends);
    }
    for (const NearEdges& pair : detector.FindEdges(x, moves_with, &one, &report))
      found.push_back(ends_of(pair));
    EXPECT_EQ(found, expected);
    kept += static_cast<int>(found.size());
  }
  EXPECT_GT(left_out, 20);
  EXPECT_GT(kept, 20);
}

// Two bodies' edges, each once, with the triangles they belong to.
struct MeshEdge {
  int p, q;
  std::vector<int> triangles;
};
std::vector<MeshEdge> EdgesOf(const Model& model, int body) {
  std::map<std::pair<int, int>, std::vector<int>> found;
  const Body& b = model.bodies[body];
  for (int t = b.first_triangle; t < b.first_triangle + b.triangle_count; ++t) {
    for (int k = 0; k < 3; ++k) {
      found[std::minmax({model.triangles[t][k], model.triangles[t][(k + 1) % 3]})].push_back(t);
    }
  }
  std::vector<MeshEdge> edges;
  for (const auto& [ends, triangles] : found) edges.push_back({ends.first, ends.second, triangles});
  return edges;
}

// Where two lines are nearest: fractions of each edge.
Eigen::Vector2d Fractions(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1) {
  Eigen::Matrix<double, 3, 2> lines;
  lines << a1 - a0, b0 - b1;
  return lines.colPivHouseholderQr().solve(b0 - a0);
}

// Every edge against every edge of other bodies. That no face at an edge is nearer to the other's
// contact point than the edge is what "leads away" means; within the tolerance a pair may be listed
// or not.
TEST(Detector, FindsTheEdgesThatBruteForceFindsWhileEverythingMoves) {
  const auto model = ModelOf(R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.5}, mass_kg: 1}
  - {name: b, icosphere: {radius_m: 0.5}, mass_kg: 1, position_m: [0.93, 0.1, 0.05], rotation_deg: [20, 40, 70]}
  - {name: plane, sheet: {length_m: 3, width_m: 3, columns: 8, rows: 8}, mass_kg: 1, position_m: [0, 0, -0.48]}
)");
  const double reach = 0.1;
  Detector detector(*model, reach, {.edges = true, .self_apart_m = std::nullopt});
  Parallel one(1), two(2);
  std::vector<Vec3> x = model->rest_position_m;
  std::vector<std::vector<MeshEdge>> edges;
  for (int b = 0; b < 3; ++b) edges.push_back(EdgesOf(*model, b));
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::size_t must = 0, total = 0;
  for (int step = 0; step < 60; ++step) {
    for (Vec3& p : x)
      p += 0.02 * Vec3(uniform(random), uniform(random), uniform(random)) + Vec3(0.002, 0, 0);
    StepReport report;
    detector.Update(x, &one, &report);
    const auto near = detector.FindEdges(x, {}, step % 2 ? &one : &two, &report);
    EXPECT_EQ(report.bits, 0u);
    std::map<std::array<int, 4>, const NearEdges*> listed;
    for (const NearEdges& pair : near) {
      const Triangle& tri = model->triangles[pair.triangle];
      std::vector<int> ends;
      for (int k = 0; k < 3; ++k) {
        if (pair.weights(k) != 0) ends.push_back(tri[k]);
      }
      ASSERT_EQ(ends.size(), 2u);
      listed[{pair.ends[0], pair.ends[1], std::min(ends[0], ends[1]), std::max(ends[0], ends[1])}] =
          &pair;
    }
    ASSERT_EQ(listed.size(), near.size()) << "a pair is listed twice";
    std::size_t known = 0;
    for (const auto& [i, j] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
      for (const MeshEdge& a : edges[i]) {
        for (const MeshEdge& b : edges[j]) {
          const Eigen::Vector2d at = Fractions(x[a.p], x[a.q], x[b.p], x[b.q]);
          const Vec3 pa = x[a.p] + at(0) * (x[a.q] - x[a.p]);
          const Vec3 pb = x[b.p] + at(1) * (x[b.q] - x[b.p]);
          const double distance = (pa - pb).norm();
          const auto it = listed.find({a.p, a.q, b.p, b.q});
          const bool inside = at.minCoeff() > 0 && at.maxCoeff() < 1 && distance <= reach;
          if (!inside) {
            EXPECT_TRUE(it == listed.end());
            continue;
          }
          // How much nearer than the edge a face is to the other's point.
          double nearest = 1;
          const auto look = [&](const std::vector<int>& triangles, const Vec3& p) {
            for (int t : triangles) {
              const Triangle& tri = model->triangles[t];
              nearest = std::min(
                  nearest,
                  std::sqrt(
                      ClosestPointOnTriangle(p, x[tri[0]], x[tri[1]], x[tri[2]]).distance_sq_m2) /
                      distance);
            }
          };
          look(a.triangles, pb);
          look(b.triangles, pa);
          if (it != listed.end()) {
            ++known;
            EXPECT_NEAR(std::abs(it->second->gap_m), distance, 1e-12);
            EXPECT_NEAR(it->second->normal.dot(pa - pb), it->second->gap_m, 1e-12);
            EXPECT_NEAR(it->second->s, at(0), 1e-6);
            // cos of the tolerated angle, for the outer side.
            if (it->second->gap_m > 0) {
              EXPECT_GE(nearest, std::sqrt(1 - 0.01) - 1e-6);
            }
          } else if (nearest > 1 - 1e-9) {
            // Nothing is nearer on this side, but both may be seen from inside a body.
            const auto outward = [&](const MeshEdge& edge, const Vec3& direction) {
              Vec3 sum = Vec3::Zero();
              for (int t : edge.triangles) {
                const Triangle& tri = model->triangles[t];
                sum += (x[tri[1]] - x[tri[0]]).cross(x[tri[2]] - x[tri[0]]).normalized();
              }
              return sum.dot(direction) >= 0;
            };
            EXPECT_FALSE((!model->bodies[i].closed || outward(a, pb - pa)) &&
                         (!model->bodies[j].closed || outward(b, pa - pb)))
                << "missed";
          }
          must += nearest > 1 - 1e-9 && it != listed.end();
        }
      }
    }
    EXPECT_EQ(known, near.size());
    total += known;
  }
  EXPECT_GT(must, 10u);
  EXPECT_GT(total, 100u);
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

// What is built from fixed parts overlaps for good.
TEST(Penetration, IsOfBodiesThatCanPart) {
  const std::string fixed_one = R"(
bodies:
  - {name: a, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1, fixed: [all: true]}
  - {name: b, icosphere: {radius_m: 0.5, subdivisions: 2}, mass_kg: 1, position_m: [0.9, 0, 0])";
  const auto one = ModelOf(fixed_one + "}\n"),
             both = ModelOf(fixed_one + ", fixed: [all: true]}\n");
  EXPECT_GT(MeasurePenetration(*one, one->rest_position_m).vertices_inside, 0);
  EXPECT_EQ(MeasurePenetration(*both, both->rest_position_m).vertices_inside, 0);
}

}  // namespace
}  // namespace adhesim::test
