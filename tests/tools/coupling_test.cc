#include "core/tools/coupling.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "core/tools/rotation.h"
#include "tests/tools/tools_for_test.h"

namespace adhesim {
namespace {

constexpr double kUnlimited = 1e12;

CouplingParameters Unlimited(double stiffness = 1000, double angular = 5) {
  CouplingParameters p;
  p.stiffness_n_m = stiffness;
  p.angular_stiffness_nm_rad = angular;
  p.max_force_n = p.max_torque_nm = p.max_speed_m_s = kUnlimited;
  return p;
}

Mat6 Inertia(double mass, double moment) {
  Mat6 m = Mat6::Zero();
  m.diagonal() << mass, mass, mass, moment, moment, moment;
  return m;
}

// A tool's inertia with a lump of tissue at `at` from the tip.
Mat6 WithTissue(Mat6 m, double mass, const Vec3& at) {
  const Mat3 c = CrossMatrix(at);
  m.topLeftCorner<3, 3>() += mass * Mat3::Identity();
  m.topRightCorner<3, 3>() += -mass * c;
  m.bottomLeftCorner<3, 3>() += mass * c;
  m.bottomRightCorner<3, 3>() += -mass * c * c;
  return m;
}

// A tool, its target, and time.
struct Follower {
  CouplingParameters parameters;
  Mat6 inertia = Inertia(0.05, 2.4e-4);
  double dt = 1e-3;
  Pose pose, target;
  Twist twist;
  Wrench applied;
  CouplingResult last;

  void Step() {
    last = FollowTarget(parameters, pose, twist, target, inertia, applied, dt);
    twist = last.twist;
    pose = Advance(pose, twist, dt);
  }
  Vec3 Error() const { return target.position_m - pose.position_m; }
  Vec3 AngularError() const { return VectorOf(target.orientation * pose.orientation.conjugate()); }
  double Energy() const {
    Vec6 v;
    v << twist.linear_m_s, twist.angular_rad_s;
    return 0.5 * v.dot(inertia * v) + 0.5 * parameters.stiffness_n_m * Error().squaredNorm() +
           0.5 * parameters.angular_stiffness_nm_rad * AngularError().squaredNorm();
  }
};

TEST(Coupling, RestsAtForceOverStiffness) {
  Follower f;
  f.parameters = Unlimited();
  f.applied = {Vec3(1, -2, 0.5), Vec3(0.1, 0, -0.2)};
  for (int i = 0; i < 2000; ++i) f.Step();
  // 280 time constants: what is left is round-off.
  EXPECT_NEAR((f.Error() + f.applied.force_n / 1000).norm(), 0, 1e-14);
  EXPECT_NEAR((f.AngularError() + f.applied.torque_nm / 5).norm(), 0, 1e-12);
  EXPECT_NEAR((f.last.wrench.force_n + f.applied.force_n).norm(), 0, 1e-10);
  EXPECT_NEAR((f.last.wrench.torque_nm + f.applied.torque_nm).norm(), 0, 1e-10);
  EXPECT_FALSE(f.last.force_limited || f.last.speed_limited);
}

TEST(Coupling, FollowsTheBackwardEulerRecursion) {
  Follower f;
  f.parameters = Unlimited();
  f.target.position_m = Vec3(0.01, 0, 0);
  f.applied.force_n = Vec3(0.3, 0, 0);
  const double m = 0.05, k = 1000, d = 2 * std::sqrt(k * m);
  double x = 0, v = 0;
  for (int i = 0; i < 100; ++i) {
    f.Step();
    // m (v' - v)/dt = k (0.01 - x - dt v') - d v' + F
    v = (m * v + f.dt * (k * (0.01 - x) + 0.3)) / (m + f.dt * d + f.dt * f.dt * k);
    x += f.dt * v;
    // The same numbers by another route: round-off.
    ASSERT_NEAR(f.pose.position_m.x(), x, 1e-15);
    ASSERT_NEAR(f.twist.linear_m_s.x(), v, 1e-12);
    ASSERT_NEAR(f.last.wrench.force_n.x(), k * (0.01 - x) - d * v, 1e-9);
  }
}

TEST(Coupling, ReachesTheTargetInItsOwnTimeWithoutPassingIt) {
  Follower f;
  f.parameters = Unlimited();
  f.dt = 1e-5;
  f.target.position_m = Vec3(0, 0.01, 0);
  const double tau = std::sqrt(0.05 / 1000);
  for (int i = 1; i <= 10000; ++i) {
    f.Step();
    const double t = i * f.dt / tau;
    // The critically damped response; backward Euler is first order, dt/tau = 1.4e-3.
    ASSERT_NEAR(f.pose.position_m.y(), 0.01 * (1 - (1 + t) * std::exp(-t)), 0.01 * 1.5e-3);
    // A critically damped spring approaches from one side; 1e-15 m is round-off.
    ASSERT_LE(f.pose.position_m.y(), 0.01 + 1e-15);
  }
}

TEST(Coupling, TurnsAboutAFixedAxisLikeItMoves) {
  Follower f;
  f.parameters = Unlimited();
  const Vec3 axis = Vec3(1, 2, -1).normalized();
  f.target.orientation = RotationOf(2.5 * axis);
  const double moment = 2.4e-4, k = 5, d = 2 * std::sqrt(k * moment);
  double angle = 0, v = 0;
  for (int i = 0; i < 200; ++i) {
    f.Step();
    v = (moment * v + f.dt * k * (2.5 - angle)) / (moment + f.dt * d + f.dt * f.dt * k);
    angle += f.dt * v;
    // Quaternion round-off gathers over 200 steps.
    ASSERT_NEAR((VectorOf(f.pose.orientation) - angle * axis).norm(), 0, 1e-12);
    ASSERT_LE(f.pose.position_m.norm(), 0);
  }
  EXPECT_NEAR(angle, 2.5, 1e-6);
}

TEST(Coupling, FollowsAJumpAtItsTopSpeed) {
  // Also for stiffnesses far from the default: the limit, not the spring, sets the pace.
  for (const double stiffness : {200.0, 1e3, 1e4, 1e6}) {
    Follower f;
    f.parameters.stiffness_n_m = stiffness;
    f.target.position_m = Vec3(0.6, 0.8, 0);
    double top = 0, furthest = 0;
    int steps = 0;
    while (f.Error().norm() > 0.01 && steps < 10000) {
      f.Step();
      ++steps;
      top = std::max(top, f.twist.linear_m_s.norm());
      if (steps == 100) {
        EXPECT_NEAR(f.twist.linear_m_s.norm(), 0.5, 1e-12) << stiffness;
        EXPECT_TRUE(f.last.speed_limited);
      }
    }
    // 0.99 m at 0.5 m/s, and some milliseconds to get there at 200 m/s^2.
    EXPECT_NEAR(steps * f.dt, 1.98, 0.03) << stiffness;
    EXPECT_LE(top, 0.5 * (1 + 1e-12));
    for (int i = 0; i < 2000; ++i) {
      f.Step();
      furthest = std::max(furthest, f.pose.position_m.norm());
    }
    EXPECT_NEAR(f.Error().norm(), 0, 1e-9) << stiffness;
    // A spring so stiff that its limit has to brake may pass by less than one step of braking
    // undoes: 200 m/s^2 dt^2.
    EXPECT_LE(furthest - 1, stiffness < 1e6 ? 1e-9 : 2e-4) << stiffness;
  }
}

TEST(Coupling, NeverPullsHarderThanItMay) {
  for (const double stiffness : {10.0, 1e3, 1e5}) {
    Follower f;
    f.parameters.stiffness_n_m = stiffness;
    f.parameters.max_force_n = 2;
    f.target = {Vec3(0.3, -0.2, 0.1), RotationOf(Vec3(1, 1, 0))};
    for (int i = 0; i < 3000; ++i) {
      f.Step();
      ASSERT_LE(f.last.wrench.force_n.norm(), 2 * (1 + 1e-12));
      ASSERT_LE(f.last.wrench.torque_nm.norm(), 1 + 1e-12);
    }
  }
}

TEST(Coupling, YieldsToAForceAboveItsLimit) {
  Follower f;
  f.parameters.max_force_n = 2;
  f.applied.force_n = Vec3(0, 0, 3);
  f.Step();
  // Until the spring is stretched it helps little; soon only the limit holds against 3 N.
  for (int i = 0; i < 30; ++i) f.Step();
  EXPECT_TRUE(f.last.force_limited);
  EXPECT_NEAR(f.last.wrench.force_n.z(), -2, 1e-12);
  // What is left accelerates 50 g. The speed limit is the coupling's, not the tissue's.
  const double before_m_s = f.twist.linear_m_s.z();
  for (int i = 0; i < 100; ++i) f.Step();
  EXPECT_NEAR(f.twist.linear_m_s.z() - before_m_s, 100 * f.dt * (3 - 2) / 0.05, 1e-12);
  EXPECT_NEAR(f.last.wrench.force_n.z(), -2, 1e-12);
}

TEST(Coupling, PointsNearTheTipKeepTheSpeedLimit) {
  Follower f;
  f.target = {Vec3(1, 0, 0), RotationOf(Vec3(0, 0, 3))};
  for (int i = 0; i < 200; ++i) {
    f.Step();
    ASSERT_LE(f.twist.linear_m_s.norm() + 0.1 * f.twist.angular_rad_s.norm(), 0.5 * (1 + 1e-12));
  }
  EXPECT_TRUE(f.last.speed_limited);
}

TEST(Coupling, EnergyNeverGrowsForAnyStiffnessStepOrLoad) {
  Numbers numbers;
  for (double stiffness = 1; stiffness <= 1e6; stiffness *= 10) {
    for (const double dt : {1e-5, 1e-4, 1e-3, 1e-2}) {
      for (const double tissue : {0.0, 0.1, 50.0}) {
        Follower f;
        f.parameters = Unlimited(stiffness, stiffness / 200);
        f.inertia = WithTissue(f.inertia, tissue, Vec3(0.01, -0.005, -0.02));
        f.dt = dt;
        f.pose.orientation = RotationOf(numbers.InBox(0.05));
        f.target.position_m = numbers.InBox(0.05);
        f.twist.linear_m_s = numbers.InBox(0.2);
        double energy = f.Energy();
        const double start = energy;
        for (int i = 0; i < 300; ++i) {
          f.Step();
          // Rotation is taken linearly within a step: exact only to second order in the angle of a
          // step (here up to some 0.05 rad), a share of the energy far below what damping takes;
          // 1e-12 is round-off.
          ASSERT_LE(f.Energy(), energy + 1e-12 * start)
              << stiffness << " " << dt << " " << tissue << " step " << i;
          energy = f.Energy();
        }
      }
    }
  }
}

TEST(Coupling, CarriedMassSlowsItAndDoesNotMakeItPassTheTarget) {
  Follower f;
  f.parameters = Unlimited();
  f.inertia = WithTissue(f.inertia, 20, Vec3::Zero());
  f.target.position_m = Vec3(0.01, 0, 0);
  for (int i = 0; i < 20000; ++i) {
    f.Step();
    ASSERT_LE(f.pose.position_m.x(), 0.01 + 1e-14);
    // The time constant is sqrt(20.05/1000) = 0.14 s: 26 % of the way after one, here at 1 % per
    // step of time.
    if (i == 141) {
      EXPECT_NEAR(f.pose.position_m.x(), 0.01 * (1 - 2 * std::exp(-1)), 0.01 * 0.01);
    }
  }
  EXPECT_NEAR(f.Error().norm(), 0, 1e-12);
}

TEST(Coupling, StaysFiniteAtTheEndsOfTheParameters) {
  for (const double stiffness : {1e-6, 1e6}) {
    for (const double angular : {1e-6, 1e5}) {
      for (const double mass : {1e-6, 100.0}) {
        Follower f;
        f.parameters.stiffness_n_m = stiffness;
        f.parameters.angular_stiffness_nm_rad = angular;
        f.inertia = Inertia(mass, mass * 1e-4);
        f.target = {Vec3(900, -900, 3), Quat(0, 0, 0, 1)};  // half a turn: the axis is ambiguous
        f.applied.force_n = Vec3(1e4, 0, 0);
        for (int i = 0; i < 500; ++i) {
          f.Step();
          ASSERT_TRUE(f.pose.position_m.allFinite() && f.twist.angular_rad_s.allFinite());
          ASSERT_NEAR(f.pose.orientation.norm(), 1, 1e-14);
        }
      }
    }
  }
}

TEST(ToolInertia, IsTheMassAtTheTipAndAThinRodsMoment) {
  ToolModel tool = Needle();
  tool.coupling.mass_kg = 0.05;
  const Mat6 m = ToolInertia(tool, {});
  EXPECT_DOUBLE_EQ(m(0, 0), 0.05);
  EXPECT_DOUBLE_EQ(m(4, 4), 0.05 * 0.12 * 0.12 / 3);
  EXPECT_EQ(m(0, 4), 0);
  EXPECT_DOUBLE_EQ(ToolInertia(Lancet(), {})(5, 5), 0.05 * 0.125 * 0.125 / 3);
}

TEST(Rotation, AgreesWithTheClosedForm) {
  Numbers numbers;
  for (int round = 0; round < 200; ++round) {
    const Vec3 axis = numbers.InBox(1).normalized();
    const double angle = numbers.Uniform(-3.1, 3.1) * std::pow(10, -numbers.Uniform(0, 8));
    const Quat expected(Eigen::AngleAxisd(angle, axis));
    EXPECT_NEAR(RotationOf(angle * axis).angularDistance(expected), 0, 1e-13);
    // Relative: small rotations keep all their digits.
    EXPECT_NEAR((VectorOf(expected) - angle * axis).norm(), 0, 1e-13 * std::abs(angle) + 1e-16);
  }
  EXPECT_NEAR(VectorOf(Quat(0, 1, 0, 0)).x(), M_PI, 1e-13);
  EXPECT_EQ(VectorOf(Quat(-1, 0, 0, 0)).norm(), 0);
}

TEST(Advance, TurnsExactlyAndKeepsTheQuaternionUnit) {
  Pose pose;
  const Twist twist{Vec3(0.1, 0, 0), Vec3(0, 0, 2 * M_PI)};
  for (int i = 0; i < 1000; ++i) pose = Advance(pose, twist, 1e-3);
  // One turn in a thousand exact steps: round-off only.
  EXPECT_NEAR(VectorOf(pose.orientation).norm(), 0, 1e-12);
  EXPECT_NEAR(pose.position_m.x(), 0.1, 1e-14);
  EXPECT_NEAR(pose.orientation.norm(), 1, 1e-15);
}

TEST(PoseAt, IsLinearBetweenWaypointsAndHeldOutside) {
  const std::vector<TimedPose> trajectory = {{1, {Vec3(0, 0, 0), Quat::Identity()}},
                                             {2, {Vec3(1, 0, 0), RotationOf(Vec3(0, 0, 1))}},
                                             {2, {Vec3(5, 0, 0), Quat::Identity()}},
                                             {4, {Vec3(5, 2, 0), Quat::Identity()}}};
  EXPECT_EQ(PoseAt(trajectory, 0).position_m, Vec3(0, 0, 0));
  EXPECT_NEAR((PoseAt(trajectory, 1.25).position_m - Vec3(0.25, 0, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((VectorOf(PoseAt(trajectory, 1.25).orientation) - Vec3(0, 0, 0.25)).norm(), 0, 1e-14);
  EXPECT_EQ(PoseAt(trajectory, 2).position_m, Vec3(5, 0, 0));
  EXPECT_NEAR((PoseAt(trajectory, 3).position_m - Vec3(5, 1, 0)).norm(), 0, 1e-15);
  EXPECT_EQ(PoseAt(trajectory, 9).position_m, Vec3(5, 2, 0));
}

// The law, solved with the tool's own inertia, is the closed form in modes.
TEST(Coupling, LawLeadsARigidToolWhereFollowTargetDoes) {
  const CouplingParameters parameters = Unlimited();
  const Mat6 inertia = WithTissue(Inertia(0.05, 2.4e-4), 0.3, Vec3(0.01, -0.02, 0.03));
  Pose target;
  target.position_m = Vec3(0.01, 0.02, -0.005);
  target.orientation = RotationOf(Vec3(0.1, -0.2, 0.05));
  const Twist twist{Vec3(0.1, 0.2, -0.1), Vec3(1, 0, -2)};
  const Wrench applied{Vec3(1, 2, 3), Vec3(0.01, 0, 0.02)};
  const double dt = 2e-3;
  const Twist followed =
      FollowTarget(parameters, Pose{}, twist, target, inertia, applied, dt).twist;
  const CouplingLaw law = LawOf(parameters, Pose{}, target, inertia, dt);
  Vec6 before, pull;
  before << twist.linear_m_s, twist.angular_rad_s;
  pull << applied.force_n, applied.torque_nm;
  const Vec6 next =
      (inertia + law.resistance).ldlt().solve(inertia * before + law.impulse + dt * pull);
  // Round-off of inertias whose modes differ by a factor of some thousand.
  EXPECT_LT((next.head<3>() - followed.linear_m_s).norm(), 1e-12);
  EXPECT_LT((next.tail<3>() - followed.angular_rad_s).norm(), 1e-11);
}

TEST(Coupling, LawBeyondTheLimitsBecomesTheLimitedWrench) {
  CouplingParameters parameters = Unlimited();
  Pose target;
  target.position_m = Vec3(0.01, 0, 0);  // 10 N
  const Mat6 inertia = Inertia(0.05, 2.4e-4);
  CouplingLaw law = LawOf(parameters, Pose{}, target, inertia, 1e-3);
  bool limited = true;
  const Vec6 whole = LimitWrench(parameters, Vec6::Zero(), 1e-3, &law, &limited);
  EXPECT_FALSE(limited);
  EXPECT_NEAR(whole(0), 10, 1e-12);
  EXPECT_GT(law.resistance.norm(), 0);
  parameters.max_force_n = 4;
  const Vec6 clipped = LimitWrench(parameters, Vec6::Zero(), 1e-3, &law, &limited);
  EXPECT_TRUE(limited);
  EXPECT_NEAR(clipped(0), 4, 1e-12);
  EXPECT_EQ(law.resistance.norm(), 0);
  EXPECT_NEAR(law.impulse(0), 4e-3, 1e-15);
}

TEST(Coupling, LimitsTheTwistToTheSpeedAndToWhatTheForceCanBrake) {
  CouplingParameters parameters = Unlimited();
  parameters.max_force_n = 10;
  Pose target;
  target.position_m = Vec3(0.01, 0, 0);
  const Mat6 inertia = Inertia(0.05, 2.4e-4);  // 200 m/s^2: 2 m/s over 10 mm
  Vec6 twist = Vec6::Zero();
  twist(0) = 5;
  const Vec6 rest = Vec6::Zero();
  EXPECT_FALSE(LimitTwist(parameters, Pose{}, target, inertia, rest, 1e-4, &twist));
  EXPECT_NEAR(twist(0), 2, 0.02);  // up to a step's braking
  parameters.max_speed_m_s = 1;
  EXPECT_TRUE(LimitTwist(parameters, Pose{}, target, inertia, rest, 1e-4, &twist));
  EXPECT_NEAR(twist(0), 1, 1e-12);
}

// 50 g that an impact has made three times as fast as the limit: 2 N take 0.04 m/s a millisecond.
TEST(Coupling, BrakesAToolThatAnImpactMadeTooFastByNoMoreThanItsForce) {
  CouplingParameters parameters = Unlimited();
  parameters.max_force_n = 2;
  parameters.max_speed_m_s = 0.5;
  const Mat6 inertia = Inertia(0.05, 2.4e-4);
  Twist twist{Vec3(0, 1.5, 0), Vec3::Zero()};
  const CouplingResult result =
      FollowTarget(parameters, Pose{}, twist, Pose{}, inertia, Wrench{}, 1e-3);
  EXPECT_NEAR(result.twist.linear_m_s.y(), 1.46, 1e-12);
  EXPECT_NEAR(result.wrench.force_n.y(), -2, 1e-12);
  // A cut would take from tissue what it gives.
  const Wrench pull{Vec3(0, 100, 0), Vec3::Zero()};
  const CouplingResult pulled =
      FollowTarget(parameters, Pose{}, twist, Pose{}, inertia, pull, 1e-3);
  EXPECT_NEAR(pulled.twist.linear_m_s.y(), 1.5 + 1e-3 * (100 - 2) / 0.05, 1e-12);
  Vec6 before = Vec6::Zero(), next = Vec6::Zero();
  before(1) = 1.5;
  next(1) = 1.48;
  LimitTwist(parameters, Pose{}, Pose{}, inertia, before, 1e-3, &next);
  EXPECT_NEAR(next(1), 1.48, 1e-12);
}

// A needle of 10 mg that carries 10 g at a lever is spun by the least torque. It gets what coupling
// and tissue give, to all digits, whatever its limits; and without tissue's forces it is hardly
// faster than it was or may aim to be, where each part clipped by itself would spin it.
TEST(Coupling, LimitsTakeNoMomentumFromWhatIsCarried) {
  Numbers numbers;
  int limited = 0;
  for (int i = 0; i < 400; ++i) {
    CouplingParameters parameters;
    parameters.max_force_n = 2;
    parameters.max_speed_m_s = 0.2;
    const Mat6 inertia = WithTissue(Inertia(1e-5, 4.8e-8), 0.01, numbers.InBox(0.06));
    const Twist twist{numbers.InBox(0.5), numbers.InBox(5)};
    Wrench pull{numbers.InBox(1), numbers.InBox(0.05)};
    if (i % 2 == 0) pull = {};
    const double dt = 4e-5;
    const Pose target{numbers.InBox(0.05), Quat::Identity()};
    const CouplingResult result =
        FollowTarget(parameters, Pose{}, twist, target, inertia, pull, dt);
    Vec6 before, after, wrench;
    before << twist.linear_m_s, twist.angular_rad_s;
    after << result.twist.linear_m_s, result.twist.angular_rad_s;
    wrench << result.wrench.force_n + pull.force_n, result.wrench.torque_nm + pull.torque_nm;
    const Vec6 got = inertia * (after - before);
    EXPECT_LE((got - dt * wrench).norm(), 1e-9 * (inertia * before).norm()) << i;
    EXPECT_LE(result.wrench.force_n.norm(), 2 * (1 + 1e-9)) << i;
    EXPECT_LE(result.wrench.torque_nm.norm(), parameters.max_torque_nm * (1 + 1e-9)) << i;
    const auto speed = [](const Vec6& u) {
      return u.head<3>().norm() + kSpeedRadius * u.tail<3>().norm();
    };
    if (i % 2 == 0) EXPECT_LE(speed(after), 1.2 * std::max(0.2, speed(before))) << i;
    limited += result.force_limited && result.speed_limited;
  }
  EXPECT_GT(limited, 40);
}

// 0.2 kg at a lever of 0.1 m, of a weight that the torque cannot hold: it falls, about a tip that
// its spring holds in place: F = m g - m a r, with a = (m g r - T) / (I + m r^2).
TEST(Coupling, HoldsItsPlaceWhenItsTorqueIsClipped) {
  constexpr double kWeight = 1.96, kArm = 0.1, kMass = 0.2, kTorque = 0.05, kMoment = 2.4e-4;
  Follower f;
  f.parameters.max_torque_nm = kTorque;
  f.inertia = WithTissue(Inertia(0.05, kMoment), kMass, Vec3(0, kArm, 0));
  f.applied = {Vec3(0, 0, -kWeight), Vec3(-kArm * kWeight, 0, 0)};
  for (int i = 0; i < 300; ++i) f.Step();
  const double turn = (kArm * kWeight - kTorque) / (kMoment + kMass * kArm * kArm);
  const double force = kWeight - kMass * turn * kArm;
  EXPECT_TRUE(f.last.force_limited);
  EXPECT_NEAR(f.last.wrench.torque_nm.norm(), kTorque, 1e-12);
  EXPECT_NEAR(f.last.wrench.force_n.z(), force, 1e-6);
  EXPECT_NEAR(f.Error().z(), force / f.parameters.stiffness_n_m, 1e-8);
}

}  // namespace
}  // namespace adhesim
