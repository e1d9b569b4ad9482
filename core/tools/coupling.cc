#include "core/tools/coupling.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/tools/rotation.h"

namespace adhesim {
namespace {

Vec6 Stack(const Vec3& linear, const Vec3& angular) {
  Vec6 v;
  v << linear, angular;
  return v;
}

// The velocity after one backward Euler step of
//   M dv/dt = K e - D v + applied,  de/dt = -v,
// with the critical damping D = 2 M^1/2 (M^-1/2 K M^-1/2)^1/2 M^1/2. In the modes of K^-1/2 M
// K^-1/2 (eigenvalues l, the squared time constants) the equations part, and each has the closed
// form
//   v' = (l v + dt (f + e)) / (sqrt(l) + dt)^2.
template <int N>
Eigen::Vector<double, N> SpringVelocity(const Eigen::Matrix<double, N, N>& inertia,
                                        const Eigen::Vector<double, N>& root_stiffness,
                                        const Eigen::Vector<double, N>& error,
                                        const Eigen::Vector<double, N>& velocity,
                                        const Eigen::Vector<double, N>& applied, double dt) {
  using Vec = Eigen::Vector<double, N>;
  const Vec inverse_root = root_stiffness.cwiseInverse();
  const Eigen::Matrix<double, N, N> scaled =
      inverse_root.asDiagonal() * inertia * inverse_root.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> modes(scaled);
  const auto& u = modes.eigenvectors();
  const Vec v = u.transpose() * root_stiffness.cwiseProduct(velocity);
  const Vec pull =
      u.transpose() * (root_stiffness.cwiseProduct(error) + inverse_root.cwiseProduct(applied));
  Vec next;
  for (int i = 0; i < N; ++i) {
    const double l = std::max(modes.eigenvalues()[i], 0.0);
    const double denominator = (std::sqrt(l) + dt) * (std::sqrt(l) + dt);
    next[i] = (l * v[i] + dt * pull[i]) / denominator;
  }
  return inverse_root.cwiseProduct(u * next);
}

// From pose to target.
Vec6 ErrorOf(const Pose& pose, const Pose& target) {
  return Stack(target.position_m - pose.position_m,
               VectorOf((target.orientation * pose.orientation.conjugate()).normalized()));
}

Vec6 RootStiffness(const CouplingParameters& parameters) {
  return Stack(Vec3::Constant(std::sqrt(parameters.stiffness_n_m)),
               Vec3::Constant(std::sqrt(parameters.angular_stiffness_nm_rad)));
}

// Scales `v` to at most `limit`; true when it was longer.
template <typename Block>
bool Clip(double limit, Block&& v) {
  const double length = v.norm();
  if (!(length > limit)) return false;
  v *= limit / length;
  return true;
}

// No point within kSpeedRadius of the tip is faster.
double SpeedOf(const Vec6& velocity) {
  return velocity.head<3>().norm() + kSpeedRadius * velocity.tail<3>().norm();
}

bool ClipSpeed(double limit, Vec6* velocity) {
  const double speed = SpeedOf(*velocity);
  if (!(speed > limit)) return false;
  *velocity *= limit / speed;
  return true;
}

// Largest speed towards a target `distance` away from which a deceleration can still stop in time,
// in steps of dt (the root of v^2 / 2a + v dt / 2 = distance, without cancellation). What one step
// can stop needs no foresight.
double BrakingSpeed(double distance, double deceleration, double dt) {
  const double step = deceleration * dt;
  return std::max(step, 4 * distance / (dt * (1 + std::sqrt(1 + 8 * distance / (step * dt)))));
}

// Keeps the velocity towards the target to what the limited force can brake.
template <typename Block>
void LimitApproach(const Vec3& error, double deceleration, double dt, Block&& velocity) {
  const double distance = error.norm();
  if (distance == 0) return;
  const Vec3 direction = error / distance;
  const double excess = velocity.dot(direction) - BrakingSpeed(distance, deceleration, dt);
  if (excess > 0) velocity -= excess * direction;
}

void LimitApproaches(const CouplingParameters& parameters, const Vec6& error, const Mat6& inertia,
                     double dt_s, Vec6* twist) {
  const double mass = inertia.topLeftCorner<3, 3>().trace() / 3;
  const double moment = inertia.bottomRightCorner<3, 3>().trace() / 3;
  LimitApproach(error.head<3>(), parameters.max_force_n / mass, dt_s, twist->head<3>());
  LimitApproach(error.tail<3>(), parameters.max_torque_nm / moment, dt_s, twist->tail<3>());
}

// Both are clipped, whichever is too large.
bool ClipWrench(const CouplingParameters& parameters, Vec6* wrench) {
  const bool force_clipped = Clip(parameters.max_force_n, wrench->head<3>());
  return Clip(parameters.max_torque_nm, wrench->tail<3>()) || force_clipped;
}

// A tool that an impact has made faster than the limit is slowed down by its coupling, within
// max_force_n, and by nothing else: to cut its speed would be an impulse that nothing exerts.
double SpeedLimit(const CouplingParameters& parameters, const Vec6& before) {
  return std::max(parameters.max_speed_m_s, SpeedOf(before));
}

// What a limited coupling does: the part of `wanted` that is furthest beyond its limit is clipped,
// and the other is found anew, as the spring that it is, of a body on which the clipped one acts.
// Where that is clipped too, the two need not belong to any motion: they would spin a light tool
// about the tissue that it carries. What is too fast by that is given `wanted`, scaled as a whole.
struct Limited {
  Vec6 wrench, velocity;
};
Limited LimitedStep(const CouplingParameters& parameters, const Mat6& inertia, const Vec6& error,
                    const Vec6& velocity, const Vec6& pull, const Vec6& wanted, double dt_s) {
  const double limit[] = {parameters.max_force_n, parameters.max_torque_nm};
  const double share[] = {limit[0] / wanted.head<3>().norm(), limit[1] / wanted.tail<3>().norm()};
  const int clipped = share[0] < share[1] ? 0 : 1, c = 3 * clipped, o = 3 - c;
  const Mat6 mobility = inertia.inverse();
  Vec6 wrench;
  wrench.segment<3>(c) = share[clipped] * wanted.segment<3>(c);
  const Mat3 own = mobility.block<3, 3>(o, o).inverse();
  const Vec3 applied = pull.segment<3>(o) + own * (mobility.block<3, 3>(o, c) *
                                                   (wrench.segment<3>(c) + pull.segment<3>(c)));
  const Vec3 before = velocity.segment<3>(o), away = error.segment<3>(o);
  Vec3 aim =
      SpringVelocity<3>(own, RootStiffness(parameters).segment<3>(o), away, before, applied, dt_s);
  Clip(o == 0 ? parameters.max_speed_m_s : parameters.max_speed_m_s / kSpeedRadius, aim);
  LimitApproach(away, limit[1 - clipped] / (own.trace() / 3), dt_s, aim);
  wrench.segment<3>(o) = own * (aim - before) / dt_s - applied;
  const auto led_to = [&](const Vec6& by) -> Vec6 {
    return velocity + dt_s * (mobility * (by + pull));
  };
  const bool both = Clip(limit[1 - clipped], wrench.segment<3>(o));
  Limited found{wrench, led_to(wrench)};
  if (!both || SpeedOf(found.velocity) <= SpeedLimit(parameters, velocity)) return found;
  const Vec6 scaled = share[clipped] * wanted, then = led_to(scaled);
  if (SpeedOf(then) < SpeedOf(found.velocity)) found = {scaled, then};
  return found;
}

}  // namespace

CouplingLaw LawOf(const CouplingParameters& parameters, const Pose& pose, const Pose& target,
                  const Mat6& inertia, double dt_s) {
  const Vec6 root = RootStiffness(parameters), inverse_root = root.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Mat6> modes(
      Mat6(inverse_root.asDiagonal() * inertia * inverse_root.asDiagonal()));
  const Vec6 times_s = modes.eigenvalues().cwiseMax(0).cwiseSqrt();
  const Mat6 u = root.asDiagonal() * modes.eigenvectors();
  const Vec6 stiffness = root.cwiseProduct(root);
  CouplingLaw law;
  law.resistance = 2 * dt_s * u * times_s.asDiagonal() * u.transpose();
  law.resistance.diagonal() += dt_s * dt_s * stiffness;
  law.impulse = dt_s * stiffness.cwiseProduct(ErrorOf(pose, target));
  return law;
}

Vec6 LimitWrench(const CouplingParameters& parameters, const Vec6& twist, double dt_s,
                 CouplingLaw* law, bool* limited) {
  Vec6 wrench = (law->impulse - law->resistance * twist) / dt_s;
  *limited = ClipWrench(parameters, &wrench);
  if (*limited) *law = {Mat6::Zero(), dt_s * wrench};
  return wrench;
}

bool LimitTwist(const CouplingParameters& parameters, const Pose& pose, const Pose& target,
                const Mat6& inertia, const Vec6& before, double dt_s, Vec6* twist) {
  LimitApproaches(parameters, ErrorOf(pose, target), inertia, dt_s, twist);
  return ClipSpeed(SpeedLimit(parameters, before), twist);
}

CouplingResult FollowTarget(const CouplingParameters& parameters, const Pose& pose,
                            const Twist& twist, const Pose& target, const Mat6& inertia,
                            const Wrench& applied, double dt_s) {
  const Vec6 error = ErrorOf(pose, target);
  const Vec6 velocity = Stack(twist.linear_m_s, twist.angular_rad_s);
  const Vec6 pull = Stack(applied.force_n, applied.torque_nm);

  // 1. The velocity that the unlimited spring leads to, then what of it the limits permit to aim
  // for.
  CouplingResult result;
  Vec6 aim = SpringVelocity<6>(inertia, RootStiffness(parameters), error, velocity, pull, dt_s);
  result.speed_limited = ClipSpeed(parameters.max_speed_m_s, &aim);
  LimitApproaches(parameters, error, inertia, dt_s, &aim);

  // 2. The wrench that takes it there, limited, and what that makes of the velocity. Without limits
  // this is the spring's and damper's wrench at the end of the step.
  Limited step{inertia * (aim - velocity) / dt_s - pull, aim};
  result.force_limited = step.wrench.head<3>().norm() > parameters.max_force_n ||
                         step.wrench.tail<3>().norm() > parameters.max_torque_nm;
  if (result.force_limited) {
    step = LimitedStep(parameters, inertia, error, velocity, pull, step.wrench, dt_s);
  }

  result.twist = {step.velocity.head<3>(), step.velocity.tail<3>()};
  result.wrench = {step.wrench.head<3>(), step.wrench.tail<3>()};
  return result;
}

double ToolLength(const ToolModel& tool) {
  if (const auto* needle = std::get_if<NeedleShape>(&tool.shape)) return needle->length_m;
  const auto& lancet = std::get<LancetShape>(tool.shape);
  return lancet.blade_length_m + lancet.handle_length_m;
}

Mat6 ToolInertia(const ToolModel& tool, const Pose& /*pose*/) {
  const double mass = tool.coupling.mass_kg, length = ToolLength(tool);
  Mat6 inertia = Mat6::Zero();
  inertia.diagonal() << Vec3::Constant(mass), Vec3::Constant(mass * length * length / 3);
  return inertia;
}

Pose Advance(const Pose& pose, const Twist& twist, double dt_s) {
  return {pose.position_m + dt_s * twist.linear_m_s,
          (RotationOf(dt_s * twist.angular_rad_s) * pose.orientation).normalized()};
}

Pose PoseAt(const std::vector<TimedPose>& trajectory, double time_s) {
  if (trajectory.empty()) return {};
  const auto after =
      std::upper_bound(trajectory.begin(), trajectory.end(), time_s,
                       [](double t, const TimedPose& timed) { return t < timed.t_s; });
  if (after == trajectory.begin()) return trajectory.front().pose;
  if (after == trajectory.end()) return trajectory.back().pose;
  const TimedPose& a = *(after - 1);
  const TimedPose& b = *after;
  const double s = (time_s - a.t_s) / (b.t_s - a.t_s);
  const Vec3 turn = VectorOf((b.pose.orientation * a.pose.orientation.conjugate()).normalized());
  return {a.pose.position_m + s * (b.pose.position_m - a.pose.position_m),
          (RotationOf(s * turn) * a.pose.orientation).normalized()};
}

}  // namespace adhesim
