#include <gtest/gtest.h>

#include <cmath>

#include "core/tools/coupling.h"
#include "core/tools/rotation.h"
#include "tests/tools/tools_for_test.h"

namespace adhesim {
namespace {

// The margin of the default needle: 1 % of its radius.
constexpr double kMargin = 0.01 * kNeedleRadius;

Pose At(const Vec3& p, const Vec3& turn = Vec3::Zero()) { return {p, RotationOf(turn)}; }

// Distance of a tool to a mesh.
double Gap(const ToolSet& tools, int tool, const Pose& pose, const TriangleMesh& mesh) {
  double least = 10;
  for (const Triangle& t : mesh.triangles) {
    ToolSet::Nearest n{};
    if (tools.NearestOnTriangle(tool, pose, mesh.vertices[t[0]], mesh.vertices[t[1]],
                                mesh.vertices[t[2]], 10, &n)) {
      least = std::min(least, n.distance_m);
    }
  }
  return least;
}

Pose Between(const Pose& from, const Pose& to, double s) {
  const Vec3 turn = VectorOf(to.orientation * from.orientation.conjugate());
  return {from.position_m + s * (to.position_m - from.position_m),
          RotationOf(s * turn) * from.orientation};
}

// Without other tools.
double SweepOne(const ToolSet& tools, int tool, const Pose& from, const Pose& to, Vec3* normal) {
  return tools.Sweep(tool, from, to, {}, normal);
}

TEST(Sweep, StopsAMarginAboveAPlate) {
  for (const double far : {0.0, 1000.0}) {
    const Vec3 origin(far, -far, far);
    // A face at z = origin.z.
    const TriangleMesh plate = BoxMesh(origin - Vec3(0, 0, 0.0005), Vec3(0.1, 0.1, 0.001));
    const auto tools = MakeTools({Needle()}, {plate});
    Vec3 normal;
    const Pose from = At(origin + Vec3(0.011, 0.007, 0.02)),
               to = At(origin + Vec3(0.013, 0.006, -0.05));
    const double s = SweepOne(*tools, 0, from, to, &normal);
    // Within a thousandth of the margin, also a kilometre away (doubles there are 1e-13 m apart).
    EXPECT_NEAR(0.02 - s * 0.07, kMargin, 1e-3 * kMargin + 1e-9);
    EXPECT_NEAR((normal - Vec3::UnitZ()).norm(), 0, 1e-9);
  }
}

TEST(Sweep, DoesNotPassThroughAThinPlateAtTenMetresPerSecond) {
  Numbers numbers;
  const TriangleMesh plate = BoxMesh(Vec3::Zero(), Vec3(0.5, 0.5, 0.001), 8);
  const auto tools = MakeTools({Needle(), Lancet()}, {plate});
  for (int round = 0; round < 200; ++round) {
    const int tool = round % 2;
    // 1 cm in a step of 1 ms from 4 mm above to below, tilted, and turning up to half a radian.
    const Vec3 tilt(numbers.Uniform(-0.7, 0.7), numbers.Uniform(-0.7, 0.7), 0);
    const Vec3 turn = numbers.InBox(0.3);
    const Vec3 start(numbers.Uniform(-0.1, 0.1), numbers.Uniform(-0.1, 0.1), 0.0045);
    const Pose from = At(start, tilt);
    const Pose to{start - Vec3(0, 0, 0.01), RotationOf(turn) * from.orientation};
    if (Gap(*tools, tool, from, plate) < kMargin) continue;
    Vec3 normal = Vec3::Zero();
    const double s = SweepOne(*tools, tool, from, to, &normal);
    EXPECT_LT(s, 1);
    EXPECT_GT(Gap(*tools, tool, Between(from, to, s), plate), 0) << round;
    EXPECT_NEAR(normal.norm(), 1, 1e-12);
    EXPECT_GT(normal.z(), 0) << round;
    // It did not stop early either: a little further on it would be within the margin.
    EXPECT_LT(Gap(*tools, tool, Between(from, to, std::min(1.0, s + 1e-3)), plate), kMargin)
        << round;
  }
}

TEST(Sweep, FindsAPlateThatOnlyTheTurnMeets) {
  // The shaft swings about the tip by a right angle and meets a post on the way; start and end are
  // clear of it.
  const TriangleMesh post = BoxMesh(Vec3(0.05, 0, 0.05), Vec3(0.002, 0.02, 0.002));
  const auto tools = MakeTools({Needle()}, {post});
  const Pose from = At(Vec3::Zero()), to = At(Vec3::Zero(), Vec3(0, M_PI / 2, 0));
  ASSERT_GT(Gap(*tools, 0, to, post), 0.01);
  Vec3 normal;
  const double s = SweepOne(*tools, 0, from, to, &normal);
  const double gap = Gap(*tools, 0, Between(from, to, s), post);
  EXPECT_GT(gap, 0.5 * kMargin);
  EXPECT_LT(gap, 1.1 * kMargin);
  EXPECT_LT(normal.dot(Vec3(1, 0, -1)), 0);
}

TEST(Sweep, LeavesFreeMotionWhole) {
  const TriangleMesh plate = BoxMesh(Vec3::Zero(), Vec3(0.1, 0.1, 0.001));
  const auto tools = MakeTools({Needle()}, {plate});
  Vec3 normal;
  // Past the edge of the plate, 1 mm away.
  EXPECT_EQ(SweepOne(*tools, 0, At(Vec3(0.0526, 0, 0.05)), At(Vec3(0.0526, 0, -0.05)), &normal), 1);
  EXPECT_EQ(SweepOne(*tools, 0, At(Vec3(0, 0, 0.01)), At(Vec3(0, 0, 0.01)), &normal), 1);
  EXPECT_EQ(SweepOne(*MakeTools({Needle()}), 0, At(Vec3(0, 0, 1)), At(Vec3(0, 0, -1)), &normal), 1);
}

TEST(Sweep, LetsATouchingToolLeaveAndSlide) {
  // A plate of many triangles, so that sliding crosses their edges.
  const TriangleMesh plate = BoxMesh(Vec3(0, 0, -0.0005), Vec3(0.1, 0.1, 0.001), 10);
  const auto tools = MakeTools({Needle(), Lancet()}, {plate});
  for (const int tool : {0, 1}) {
    Vec3 normal;
    const Pose start = At(Vec3(-0.04, 0.001, 0.01));
    const double s = SweepOne(*tools, tool, start, At(Vec3(-0.04, 0.001, -0.01)), &normal);
    ASSERT_LT(s, 1);
    const Pose touching = Between(start, At(Vec3(-0.04, 0.001, -0.01)), s);
    // Further in: nothing (the last thousandth of the margin apart). Away, along, and along while
    // turning: everything.
    EXPECT_LT(
        SweepOne(*tools, tool, touching, At(touching.position_m - Vec3(0, 0, 0.001)), &normal),
        1e-4);
    EXPECT_EQ(
        SweepOne(*tools, tool, touching, At(touching.position_m + Vec3(0, 0, 0.001)), &normal), 1);
    EXPECT_EQ(
        SweepOne(*tools, tool, touching, At(touching.position_m + Vec3(0.08, 0.01, 0)), &normal),
        1);
    EXPECT_EQ(
        SweepOne(*tools, tool, touching,
                 At(touching.position_m + Vec3(0.001, 0.01, 0), Vec3(0.01, 0.02, 0.1)), &normal),
        1);
  }
}

TEST(Sweep, LetsAnOverlappingToolOutAndNoDeeper) {
  const TriangleMesh plate = BoxMesh(Vec3(0, 0, -0.0005), Vec3(0.1, 0.1, 0.001));
  const auto tools = MakeTools({Needle()}, {plate});
  Vec3 normal;
  const Pose inside = At(Vec3(0.011, 0.007, -0.0004));
  EXPECT_EQ(SweepOne(*tools, 0, inside, At(Vec3(0.011, 0.007, 0.01)), &normal), 1);
  EXPECT_LT(SweepOne(*tools, 0, inside, At(Vec3(0.011, 0.007, -0.01)), &normal), 1e-3);
}

TEST(Sweep, DoesNotCreepIntoAPlateThatItIsPressedAgainst) {
  const TriangleMesh plate = BoxMesh(Vec3(0, 0, -0.0005), Vec3(0.1, 0.1, 0.001), 3);
  const auto tools = MakeTools({Needle()}, {plate});
  Pose pose = At(Vec3(0.011, 0.007, 0.001));
  Vec3 normal;
  for (int i = 0; i < 20000; ++i) {
    const Pose to = At(pose.position_m + Vec3(0, 0, -1e-5));
    pose = Between(pose, to, SweepOne(*tools, 0, pose, to, &normal));
  }
  // Each press may use a millionth of what is left: 2 % in 20,000 steps, and never all of it.
  EXPECT_GT(Gap(*tools, 0, pose, plate), 0.9 * kMargin);
}

TEST(Sweep, StopsAtAnotherTool) {
  const auto tools = MakeTools({Needle(), Lancet()});
  // The lancet's handle lies along x at z = 0 .. 6 mm; the needle comes down on it.
  const std::vector<Pose> poses = {At(Vec3(0.08, 0, 0.02)),
                                   At(Vec3(0, 0, 0), Vec3(0, M_PI / 2, 0))};
  Vec3 normal;
  const double s = tools->Sweep(0, poses[0], At(Vec3(0.08, 0, -0.02)), poses, &normal);
  // Single steps of the walk over round shapes end within 1e-9 m.
  EXPECT_NEAR(0.02 - s * 0.04, 0.003 + kMargin, 2e-3 * kMargin);
  EXPECT_NEAR((normal - Vec3::UnitZ()).norm(), 0, 1e-6);
  EXPECT_EQ(tools->Sweep(0, poses[0], At(Vec3(0.08, 0, 0.03)), poses, &normal), 1);
}

TEST(Sweep, PartsToolsThatOverlap) {
  const auto tools = MakeTools({Needle(), Needle()});
  // Crossed shafts, their axes 1 mm apart: they overlap by 2 mm.
  const std::vector<Pose> poses = {At(Vec3(0.06, 0.001, -0.06)),
                                   At(Vec3(0, 0, 0), Vec3(0, M_PI / 2, 0))};
  Vec3 normal;
  EXPECT_EQ(tools->Sweep(0, poses[0], At(Vec3(0.06, 0.01, -0.06)), poses, &normal), 1);
  EXPECT_LT(tools->Sweep(0, poses[0], At(Vec3(0.06, -0.01, -0.06)), poses, &normal), 1e-3);
  EXPECT_GT(normal.y(), 0.99);
}

TEST(Sweep, SurvivesDegenerateObstaclesAndPoses) {
  TriangleMesh mesh;
  mesh.vertices = {Vec3(0, 0, 0), Vec3(0, 0, 0), Vec3(0.01, 0, 0), Vec3(0.02, 0, 0)};
  mesh.triangles = {{0, 0, 0}, {0, 1, 2}, {0, 2, 3}};
  const auto tools = MakeTools({Needle()}, {mesh, TriangleMesh{}});
  Vec3 normal;
  const double s =
      SweepOne(*tools, 0, At(Vec3(0.005, 0, 0.01)), At(Vec3(0.005, 0, -0.01)), &normal);
  EXPECT_NEAR(0.01 - 0.02 * s, kMargin, 1e-2 * kMargin);
  const double nan = std::nan("");
  EXPECT_EQ(SweepOne(*tools, 0, At(Vec3(0, 0, 0.01)), At(Vec3(nan, 0, 0)), &normal), 0);
}

TEST(ToolOnAPlate, IsStoppedSlidesAndFollowsAgain) {
  // The target goes through a rigid plate, along below it, and out again.
  const TriangleMesh plate = BoxMesh(Vec3(0, 0, -0.0005), Vec3(0.1, 0.1, 0.001), 5);
  const auto tools = MakeTools({Needle()}, {plate});
  const ToolModel tool = Needle();
  const Mat6 inertia = ToolInertia(tool, {});
  const double dt = 1e-3;
  Pose pose = At(Vec3(-0.03, 0.002, 0.01));
  Twist twist;
  const auto follow = [&](const Vec3& target, int steps) {
    double lowest = 1;
    for (int i = 0; i < steps; ++i) {
      const CouplingResult pull =
          FollowTarget(tool.coupling, pose, twist, At(target), inertia, {}, dt);
      twist = pull.twist;
      // Up to two tries: as far as it goes, then along what it met.
      double left = dt;
      for (int attempt = 0; attempt < 2 && left > 0; ++attempt) {
        const Pose to = Advance(pose, twist, left);
        Vec3 normal;
        const double s = SweepOne(*tools, 0, pose, to, &normal);
        pose = Between(pose, to, s);
        left *= 1 - s;
        if (s < 1) twist.linear_m_s -= std::min(0.0, normal.dot(twist.linear_m_s)) * normal;
      }
      lowest = std::min(lowest, Gap(*tools, 0, pose, plate));
    }
    return lowest;
  };
  EXPECT_GT(follow(Vec3(-0.03, 0.002, -0.02), 500), 0);
  EXPECT_NEAR(pose.position_m.z(), kMargin, 0.01 * kMargin);
  EXPECT_GT(follow(Vec3(0.03, 0.01, -0.02), 1000), 0);
  // It lies still above the target, held only by the plate; 1e-6 m: the end of an exponential
  // approach.
  EXPECT_NEAR((pose.position_m - Vec3(0.03, 0.01, kMargin)).norm(), 0, 1e-6);
  EXPECT_GT(follow(Vec3(0.03, 0.01, 0.01), 500), 0);
  EXPECT_NEAR((pose.position_m - Vec3(0.03, 0.01, 0.01)).norm(), 0, 1e-6);
}

}  // namespace
}  // namespace adhesim
