#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/tools/bullet_bodies.h"
#include "core/tools/gjk.h"
#include "core/tools/solid.h"
#include "tests/tools/tools_for_test.h"

namespace adhesim {
namespace {

constexpr double kFar = 1.0;

// Distances are computed in double to 1e-15 m; a few more of round-off.
constexpr double kClose = 1e-13;

ToolSet::Nearest NearestTo(const ToolSet& tools, const Vec3& a, const Vec3& b, const Vec3& c,
                           const Pose& pose = {}, int tool = 0) {
  ToolSet::Nearest nearest{};
  EXPECT_TRUE(tools.NearestOnTriangle(tool, pose, a, b, c, kFar, &nearest));
  return nearest;
}

// What must hold whatever the triangle.
void ExpectConsistent(const ToolSet::Nearest& n, const Vec3& a, const Vec3& b, const Vec3& c) {
  EXPECT_TRUE(std::isfinite(n.distance_m));
  EXPECT_NEAR(n.normal.norm(), 1, 1e-12);
  EXPECT_NEAR(n.weights.sum(), 1, 1e-12);
  EXPECT_GE(n.weights.minCoeff(), -1e-12);
  EXPECT_NEAR((n.weights[0] * a + n.weights[1] * b + n.weights[2] * c - n.point_m).norm(), 0,
              1e-12 * (1 + n.point_m.norm()));
  EXPECT_GE(n.axial_m, 0);
}

TEST(NeedleDistance, ShaftSideIsDistanceToTheAxisMinusTheRadius) {
  const auto tools = MakeTools({Needle()});
  // A triangle beside the shaft, tilted; its nearest corner is at (0.01, 0, 0.05).
  const Vec3 a(0.01, 0, 0.05), b(0.02, 0.01, 0.06), c(0.02, -0.01, 0.03);
  const auto n = NearestTo(*tools, a, b, c);
  EXPECT_NEAR(n.distance_m, 0.01 - kNeedleRadius, kClose);
  EXPECT_NEAR((n.point_m - a).norm(), 0, 1e-6);
  EXPECT_NEAR(n.normal.x(), 1, 1e-9);
  EXPECT_NEAR(n.axial_m, 0.05, 1e-6);
  ExpectConsistent(n, a, b, c);
}

TEST(NeedleDistance, ShaftAgainstAFaceThatIsParallelToIt) {
  const auto tools = MakeTools({Needle()});
  const Vec3 a(0.004, -0.1, 0.02), b(0.004, 0.1, 0.02), c(0.004, 0, 0.1);
  const auto n = NearestTo(*tools, a, b, c);
  EXPECT_NEAR(n.distance_m, 0.004 - kNeedleRadius, kClose);
  EXPECT_NEAR(n.normal.x(), 1, 1e-12);
}

TEST(NeedleDistance, TipAboveAFace) {
  const auto tools = MakeTools({Needle()});
  for (const double gap : {0.01, 1e-4, 1e-7, -1e-4}) {
    const Vec3 a(-0.01, -0.02, -gap), b(0.03, -0.01, -gap), c(-0.01, 0.02, -gap);
    const auto n = NearestTo(*tools, a, b, c);
    // Inside, the deepest point lies on the axis; its distance to the cone is depth * sin(half
    // angle).
    const double sine = kNeedleRadius / std::hypot(kNeedleRadius, kNeedleTip);
    EXPECT_NEAR(n.distance_m, gap > 0 ? gap : gap * sine, kClose) << gap;
    EXPECT_NEAR(n.normal.z(), -1, 1e-9) << gap;
    EXPECT_NEAR(n.point_m.head<2>().norm(), 0, 1e-8) << gap;
    ExpectConsistent(n, a, b, c);
  }
}

TEST(NeedleDistance, ConeSideIsDistanceToItsLine) {
  const auto tools = MakeTools({Needle()});
  // A point triangle in the plane y = 0 beside the middle of the cone.
  const double length = std::hypot(kNeedleRadius, kNeedleTip);
  const Vec3 outwards(kNeedleTip / length, 0, -kNeedleRadius / length);
  const Vec3 p = Vec3(kNeedleRadius / 2, 0, kNeedleTip / 2) + 0.003 * outwards;
  const auto n = NearestTo(*tools, p, p, p);
  EXPECT_NEAR(n.distance_m, 0.003, kClose);
  EXPECT_NEAR((n.normal - outwards).norm(), 0, 1e-9);
  EXPECT_NEAR(n.axial_m, kNeedleTip / 2, 1e-9);
}

TEST(NeedleDistance, EndCapAndItsRim) {
  const auto tools = MakeTools({Needle()});
  const Vec3 above(0, 0, kNeedleLength + 0.002);
  auto n = NearestTo(*tools, above, above + Vec3(0.01, 0, 0.001), above + Vec3(0, 0.01, 0.001));
  EXPECT_NEAR(n.distance_m, 0.002, kClose);
  EXPECT_NEAR(n.axial_m, kNeedleLength, 1e-9);
  const Vec3 beyond_rim(kNeedleRadius + 0.003, 0, kNeedleLength + 0.004);
  n = NearestTo(*tools, beyond_rim, beyond_rim, beyond_rim);
  EXPECT_NEAR(n.distance_m, 0.005, kClose);
  EXPECT_NEAR((n.normal - Vec3(0.6, 0, 0.8)).norm(), 0, 1e-9);
}

TEST(NeedleDistance, InsideIsNegativeDepthOfTheDeepestPoint) {
  const auto tools = MakeTools({Needle()});
  // A corner 0.5 mm inside the shaft's side.
  const Vec3 a(kNeedleRadius - 0.0005, 0, 0.05), b(0.01, 0.005, 0.05), c(0.01, -0.005, 0.05);
  auto n = NearestTo(*tools, a, b, c);
  EXPECT_NEAR(n.distance_m, -0.0005, kClose);
  EXPECT_NEAR(n.normal.x(), 1, 1e-9);
  // A face right across the shaft: as deep as the shaft is thick; the normal points ahead of the
  // tip.
  n = NearestTo(*tools, {-0.01, -0.01, 0.05}, {0.02, -0.01, 0.05}, {-0.01, 0.02, 0.05});
  EXPECT_NEAR(n.distance_m, -kNeedleRadius, kClose);
  EXPECT_NEAR(n.normal.z(), -1, 1e-12);
}

// Least signed distance over a triangle by a grid: an upper bound that is off by at most the grid's
// spacing.
double GridDistance(const Solid& solid, const TriangleCorners& t, int cells) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= cells; ++i) {
    for (int j = 0; i + j <= cells; ++j) {
      const double u = static_cast<double>(i) / cells, v = static_cast<double>(j) / cells;
      least = std::min(least, SignedDistance(solid, (1 - u - v) * t[0] + u * t[1] + v * t[2]));
    }
  }
  return least;
}

TEST(SolidDistance, IsTheLeastOverTheTriangle) {
  Numbers numbers;
  for (const ToolShape& shape : {Needle().shape, Lancet().shape}) {
    for (const Solid& solid : SolidsOf(shape)) {
      for (int round = 0; round < 60; ++round) {
        // Around the solid's lower end, so that tips, shoulders and sides all occur, outside and
        // inside.
        const Vec3 centre = numbers.InBox(0.004) + Vec3(0, 0, BoxOf(solid).min.z() + 0.003);
        const TriangleCorners t = {centre + numbers.InBox(0.004), centre + numbers.InBox(0.004),
                                   centre + numbers.InBox(0.004)};
        SolidNearest n;
        ASSERT_TRUE(NearestOnTriangle(solid, t, kFar, &n));
        // No point of the triangle is nearer, and the point given is as near as claimed.
        const int cells = 40;
        const double grid = GridDistance(solid, t, cells);
        EXPECT_LE(n.distance_m, grid + 1e-11);
        const double spacing =
            ((t[1] - t[0]).norm() + (t[2] - t[0]).norm() + (t[2] - t[1]).norm()) / cells;
        EXPECT_GE(n.distance_m, grid - spacing);
        EXPECT_NEAR(SignedDistance(solid, n.point_m), n.distance_m, 1e-10);
      }
    }
  }
}

TEST(SolidDistance, OfARoundAgreesWithGjkOutside) {
  // Two ways to the same number: slices of the triangle, and the walk over support points.
  Numbers numbers;
  const Solid solid = SolidsOf(Needle().shape)[0];
  int outside = 0;
  for (int round = 0; round < 300; ++round) {
    const Vec3 centre = numbers.InBox(0.006) + Vec3(0, 0, numbers.Uniform(0, kNeedleLength));
    const TriangleCorners t = {centre + numbers.InBox(0.01), centre + numbers.InBox(0.01),
                               centre + numbers.InBox(0.01)};
    SolidNearest n;
    ASSERT_TRUE(NearestOnTriangle(solid, t, kFar, &n));
    const GjkResult gjk = Gjk([&](const Vec3& d) { return SupportPoint(solid, d); },
                              [&](const Vec3& d) {
                                int best = 0;
                                for (int k = 1; k < 3; ++k) {
                                  if (t[k].dot(d) > t[best].dot(d)) best = k;
                                }
                                return SupportOfB{t[best], best};
                              });
    EXPECT_EQ(gjk.overlap, n.distance_m <= 0) << round;
    if (n.distance_m <= 0) continue;
    ++outside;
    // On round surfaces the walk closes in slowly; 64 rounds leave less than a nanometre or two
    // here.
    EXPECT_NEAR(gjk.from_a_to_b.norm(), n.distance_m, 5e-9) << round;
  }
  EXPECT_GT(outside, 100);
}

TEST(SolidDistance, SupportsAreThoseOfBulletsShapes) {
  Numbers numbers;
  for (const ToolShape& shape : {Needle().shape, Lancet().shape}) {
    const ToolBody body(shape);
    for (int round = 0; round < 500; ++round) {
      const Vec3 d = numbers.InBox(1).normalized();
      double furthest = -1;
      for (const Solid& solid : body.solids())
        furthest = std::max(furthest, d.dot(SupportPoint(solid, d)));
      // Single precision of 0.125 m.
      EXPECT_NEAR(d.dot(body.BulletSupport(d)), furthest, 1e-7);
    }
  }
}

TEST(LancetDistance, BladeTipPlaneAndEdge) {
  const auto tools = MakeTools({Lancet()});
  // The tip is a point at the origin.
  auto n = NearestTo(*tools, {-0.01, -0.01, -0.001}, {0.02, -0.01, -0.001}, {-0.01, 0.02, -0.001});
  EXPECT_NEAR(n.distance_m, 0.001, 1e-12);
  EXPECT_NEAR(n.axial_m, 0, 1e-12);
  // The blade is as wide as it says along y ...
  n = NearestTo(*tools, {0, 0.004, 0.02}, {0, 0.01, 0.03}, {0, 0.01, 0.01});
  EXPECT_NEAR(n.distance_m, 0.001, 1e-12);
  EXPECT_NEAR(n.normal.y(), 1, 1e-9);
  // ... and as thick along x.
  n = NearestTo(*tools, {0.0013, 0, 0.02}, {0.01, 0.001, 0.02}, {0.01, -0.001, 0.02});
  EXPECT_NEAR(n.distance_m, 0.001, 1e-12);
  // A face across the blade: as deep as its distance from the middle to the sides.
  n = NearestTo(*tools, {-0.1, -0.1, 0.02}, {0.2, -0.1, 0.02}, {-0.1, 0.2, 0.02});
  EXPECT_NEAR(n.distance_m, -0.0003 * 0.003 / std::hypot(0.0003, 0.003), 1e-9);
  EXPECT_NEAR(std::abs(n.normal.z()), 1, 1e-9);
}

TEST(LancetDistance, HandleIsARoundBar) {
  const auto tools = MakeTools({Lancet()});
  const auto n = NearestTo(*tools, {0, 0.01, 0.08}, {0.001, 0.02, 0.08}, {-0.001, 0.02, 0.08});
  EXPECT_NEAR(n.distance_m, 0.007, kClose);
  EXPECT_NEAR(n.axial_m, 0.08, 1e-6);
}

TEST(ToolDistance, DoesNotDependOnPlaceOrOrientation) {
  const auto tools = MakeTools({Needle(), Lancet()});
  Numbers numbers;
  for (int round = 0; round < 200; ++round) {
    const int tool = round % 2;
    const Vec3 centre = numbers.InBox(0.005) + Vec3(0, 0, 0.01);
    const Vec3 a = centre + numbers.InBox(0.01), b = centre + numbers.InBox(0.01),
               c = centre + numbers.InBox(0.01);
    const auto here = NearestTo(*tools, a, b, c, {}, tool);
    const Pose pose{numbers.InBox(1000), numbers.Rotation()};
    const auto there = NearestTo(*tools, pose * a, pose * b, pose * c, pose, tool);
    // A kilometre away doubles are 1e-13 m apart.
    EXPECT_NEAR(there.distance_m, here.distance_m, 1e-9);
    EXPECT_NEAR(there.weights.sum(), 1, 1e-12);
  }
}

TEST(ToolDistance, LargeTrianglesAreAsExactAsSmallOnes) {
  const auto tools = MakeTools({Needle(), Lancet()});
  for (const double size : {0.1, 10.0, 1000.0}) {
    for (const int tool : {0, 1}) {
      const auto n = NearestTo(*tools, {-size, -size, -0.003}, {2 * size, -size, -0.003},
                               {-size, 2 * size, -0.003}, {}, tool);
      EXPECT_NEAR(n.distance_m, 0.003, 1e-9) << size;
      const auto side = NearestTo(*tools, {0.02, -size, -size}, {0.02, 2 * size, -size},
                                  {0.02, -size, 2 * size}, {}, tool);
      EXPECT_NEAR(side.distance_m, 0.02 - (tool == 0 ? kNeedleRadius : 0.003), 1e-9) << size;
    }
  }
}

TEST(ToolDistance, IsFiniteOnDegenerateTriangles) {
  const auto tools = MakeTools({Needle(), Lancet()});
  const std::vector<std::array<Vec3, 3>> triangles = {
      {Vec3(0.003, 0, 0.01), Vec3(0.003, 0, 0.01), Vec3(0.003, 0, 0.01)},  // a point
      {Vec3(-0.01, 0, 0.01), Vec3(0.01, 0, 0.01), Vec3(0, 0, 0.01)},  // a line through the axis
      {Vec3(0, 0, -0.01), Vec3(0, 0, 0.5), Vec3(0, 0, 0.2)},          // along the axis
      {Vec3(0, 0, 0), Vec3(0, 0, 0), Vec3(0.01, 0, 0)},               // at the tip
      {Vec3(0.01, 0, 0.02), Vec3(0.01, 1e-18, 0.02), Vec3(0.01, 0, 0.020000001)},  // a sliver
      {Vec3(0, 0, 0), Vec3(0, 0, 0), Vec3(0, 0, 0)}};
  for (const int tool : {0, 1}) {
    for (const auto& [a, b, c] : triangles)
      ExpectConsistent(NearestTo(*tools, a, b, c, {}, tool), a, b, c);
  }
}

TEST(ToolDistance, RefusesWhatIsTooFarOrNotFinite) {
  const auto tools = MakeTools({Needle(), Lancet()});
  ToolSet::Nearest n{};
  const Vec3 a(0.01, 0, 0.05), b(0.02, 0.01, 0.06), c(0.02, -0.01, 0.03);
  EXPECT_FALSE(tools->NearestOnTriangle(0, {}, a, b, c, 0.0084, &n));
  EXPECT_TRUE(tools->NearestOnTriangle(0, {}, a, b, c, 0.0086, &n));
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, -inf}) {
    for (const int tool : {0, 1}) {
      EXPECT_FALSE(tools->NearestOnTriangle(tool, {}, Vec3(bad, 0, 0), b, c, kFar, &n));
      EXPECT_FALSE(tools->NearestOnTriangle(tool, {}, a, Vec3(0, 0, bad), c, kFar, &n));
    }
  }
}

TEST(ToolDistance, GivesTheSameBitsEachTime) {
  const auto tools = MakeTools({Needle(), Lancet()});
  Numbers numbers;
  for (int round = 0; round < 50; ++round) {
    const Vec3 a = numbers.InBox(0.01), b = numbers.InBox(0.01), c = numbers.InBox(0.01);
    const auto first = NearestTo(*tools, a, b, c, {}, round % 2),
               second = NearestTo(*tools, a, b, c, {}, round % 2);
    EXPECT_EQ(first.distance_m, second.distance_m);
    EXPECT_EQ(first.normal, second.normal);
    EXPECT_EQ(first.weights, second.weights);
  }
}

TEST(ToolBounds, TouchTheToolOnEverySide) {
  const auto tools = MakeTools({Needle()});
  const Aabb upright = tools->Bounds(0, {});
  EXPECT_NEAR((upright.min - Vec3(-kNeedleRadius, -kNeedleRadius, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((upright.max - Vec3(kNeedleRadius, kNeedleRadius, kNeedleLength)).norm(), 0, 1e-15);
  // On its side, along +x (a quarter turn about y).
  const Pose lying{Vec3(1, 2, 3), Quat(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitY()))};
  const Aabb box = tools->Bounds(0, lying);
  EXPECT_NEAR((box.min - Vec3(1, 2 - kNeedleRadius, 3 - kNeedleRadius)).norm(), 0, 1e-15);
  EXPECT_NEAR((box.max - Vec3(1 + kNeedleLength, 2 + kNeedleRadius, 3 + kNeedleRadius)).norm(), 0,
              1e-15);
}

TEST(ToolSet, RefusesImpossibleShapesAndObstacles) {
  ToolModel bad = Needle();
  std::get<NeedleShape>(bad.shape).radius_m = 0;
  EXPECT_EQ(ToolSet::Create(std::vector{bad}, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
  bad = Needle();
  std::get<NeedleShape>(bad.shape).tip_length_m = 0.2;
  EXPECT_EQ(ToolSet::Create(std::vector{bad}, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
  bad = Lancet();
  std::get<LancetShape>(bad.shape).blade_width_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(ToolSet::Create(std::vector{bad}, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
  const std::vector<Vec3> points = {Vec3::Zero(), Vec3::UnitX(), Vec3(0, NAN, 0)};
  const std::vector<Triangle> nan = {{0, 1, 2}}, out_of_range = {{0, 1, 3}};
  for (const auto& triangles : {nan, out_of_range}) {
    const std::vector<ToolSet::Obstacle> obstacles = {{points, triangles}};
    EXPECT_EQ(ToolSet::Create({}, obstacles).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace adhesim
