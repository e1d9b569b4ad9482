#include "core/solve/rigid_group.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

// Directions of less inertia than this share of the total carry no motion that double precision can
// tell.
constexpr double kRank = 1e-12;
constexpr double kIllConditioned = 1e-4;
constexpr double kLine = 1e-6;                 // of an inertia, where all axes are asked for
constexpr double kOnAxis = 1e-6;               // rad
constexpr double kAnglePerSubRotation = 0.25;  // rad; Newton then converges in 3 to 5 iterations
constexpr int kMaxSubRotations = 64;
// Of the angular momentum, that Newton may leave: rounding leaves 1e-10 of a thin zone's. Where it
// leaves more, smaller angles help: a zone of particles on a line, which spins 200 times as fast as
// it tumbles, gained four times its energy.
constexpr double kMet = 1e-9;

// `about(axis)`: the moment of inertia about an axis, summed anew from the particles. A small
// eigenvalue has lost its digits in the matrix: near a line, a wrong one would break the
// projection's energy balance.
template <typename About>
Mat3 PseudoInverse(const Mat3& inertia, const About& about) {
  const double trace = inertia.trace();
  if (!(trace > 0)) return Mat3::Zero();
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(inertia);
  Mat3 inverse = Mat3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vec3 axis = eigen.eigenvectors().col(k);
    double value = eigen.eigenvalues()(k);
    if (value < kIllConditioned * trace) value = about(axis);
    if (value > kRank * trace) inverse += axis * axis.transpose() / value;
  }
  return inverse;
}

// One step of implicit midpoint for Pi' = Pi x I^-1 Pi, and the midpoint's angular velocity. False
// where Newton has not found it.
bool StepMidpoint(const Mat3& inverse_inertia, double dt_s, Vec3* pi, Vec3* omega) {
  const Vec3 start = *pi;
  Vec3 end = start;
  double left_sq = 0;
  for (int iteration = 0; iteration < 16; ++iteration) {
    const Vec3 middle = 0.5 * (start + end);
    *omega = inverse_inertia * middle;
    const Vec3 residual = end - start - dt_s * middle.cross(*omega);
    left_sq = residual.squaredNorm();
    if (left_sq <= 1e-32 * start.squaredNorm()) break;
    const Mat3 jacobian =
        Mat3::Identity() -
        0.5 * dt_s * (CrossMatrix(middle) * inverse_inertia - CrossMatrix(*omega));
    end -= jacobian.inverse() * residual;
  }
  *pi = end;
  return left_sq <= kMet * kMet * start.squaredNorm();
}

// How a free body of angular momentum `pi` turns. False as StepMidpoint().
bool TurnInParts(const Mat3& inverse_inertia, Vec3 pi, double dt_s, int parts, Quat* turned) {
  *turned = Quat::Identity();
  bool met = true;
  Vec3 omega;
  for (int k = 0; k < parts; ++k) {
    met = StepMidpoint(inverse_inertia, dt_s / parts, &pi, &omega) && met;
    *turned = *turned * RotationStep(omega, dt_s / parts);
  }
  return met;
}

}  // namespace

Quat RotationStep(const Vec3& angular_rad_s, double dt_s) {
  const Vec3 half = 0.5 * dt_s * angular_rad_s;
  return Quat(1, half.x(), half.y(), half.z()).normalized();
}

void Hold::Add(const Vec3& x) {
  const Vec3 way = x - point_m;
  if (points == 0) {
    point_m = x;
    points = 1;
  } else if (points == 1 && !way.isZero()) {
    axis = way.normalized();
    points = 2;
  } else if (points == 2 && way.cross(axis).norm() > kOnAxis * way.norm()) {
    Lock();
  }
}

Mat3 Hold::InverseInertia(const Mat3& spread_kg_m2) const {
  const Mat3 inertia = spread_kg_m2.trace() * Mat3::Identity() - spread_kg_m2;
  const double size = inertia.trace() / 3;
  if (points < 2) {
    const bool turns = inertia.determinant() > kLine * size * size * size;
    return turns ? Mat3(inertia.inverse()) : Mat3(Mat3::Zero());
  }
  const double about = axis.dot(inertia * axis);
  const bool turns = !locked() && about > kLine * size;
  return turns ? Mat3(axis * axis.transpose() / about) : Mat3(Mat3::Zero());
}

RigidGroup RigidGroup::Of(std::span<const std::int32_t> members, std::span<const Vec3> position_m,
                          std::span<const double> mass_kg, std::span<const std::uint8_t> fixed,
                          const Pose* tool) {
  RigidGroup group;
  int pins = 0;
  Vec3 pin_mean = Vec3::Zero();
  // About the first member, so that far from the origin nothing is lost.
  const Vec3 origin = position_m[members[0]];
  for (int p : members) {
    if (fixed[p]) {
      ++pins;
      pin_mean += position_m[p] - origin;
    } else {
      group.mass_kg += mass_kg[p];
      group.centre_m += mass_kg[p] * (position_m[p] - origin);
    }
  }
  group.centre_m =
      origin + (group.mass_kg > 0 ? Vec3(group.centre_m / group.mass_kg) : Vec3::Zero());
  group.pivot_m = tool       ? tool->position_m
                  : pins > 0 ? Vec3(origin + pin_mean / pins)
                             : group.centre_m;

  Mat3 pin_spread = Mat3::Zero();
  double extent_sq = 0;
  for (int p : members) {
    const Vec3 r = position_m[p] - group.pivot_m;
    extent_sq = std::max(extent_sq, r.squaredNorm());
    if (fixed[p]) {
      pin_spread += r * r.transpose();
    } else {
      group.inertia += mass_kg[p] * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
    }
  }
  const auto about = [&](const Vec3& axis) {
    double sum = 0;
    for (int p : members) {
      if (!fixed[p]) sum += mass_kg[p] * axis.cross(position_m[p] - group.pivot_m).squaredNorm();
    }
    return sum;
  };
  if (tool) {
    group.freedom = Freedom::kDriven;
  } else if (pins == 0) {
    group.inverse_inertia = PseudoInverse(group.inertia, about);
  } else {
    // Fixed particles at one point leave three rotations, on a line one, else none.
    const Eigen::SelfAdjointEigenSolver<Mat3> spread(pin_spread);
    const double tolerance = 1e-12 * extent_sq * pins;
    if (spread.eigenvalues()(2) <= tolerance) {
      group.freedom = Freedom::kPoint;
      group.inverse_inertia = PseudoInverse(group.inertia, about);
    } else if (spread.eigenvalues()(1) <= tolerance) {
      group.freedom = Freedom::kAxis;
      const Vec3 axis = spread.eigenvectors().col(2);
      const double about_axis = axis.dot(group.inertia * axis);
      if (about_axis > kRank * group.inertia.trace())
        group.inverse_inertia = axis * axis.transpose() / about_axis;
    } else {
      group.freedom = Freedom::kLocked;
    }
  }
  return group;
}

void RigidGroup::Project(std::span<const std::int32_t> members, std::span<const Vec3> position_m,
                         std::span<const double> mass_kg, std::span<const Vec3> velocity_m_s) {
  linear_momentum.setZero();
  angular_momentum.setZero();
  for (int p : members) {
    const Vec3 momentum = mass_kg[p] * velocity_m_s[p];
    linear_momentum += momentum;
    angular_momentum += (position_m[p] - pivot_m).cross(momentum);
  }
  if (!driven()) twist = Response(linear_momentum, angular_momentum);
}

Twist RigidGroup::Response(const Vec3& impulse, const Vec3& moment) const {
  switch (freedom) {
    case Freedom::kFree:
      return {impulse / mass_kg, inverse_inertia * moment};
    case Freedom::kPoint:
    case Freedom::kAxis:
      return {Vec3::Zero(), inverse_inertia * moment};
    case Freedom::kLocked:
    case Freedom::kDriven:
      break;
  }
  return {};
}

void RigidGroup::AddImpulse(const Vec3& impulse, const Vec3& moment) {
  linear_momentum += impulse;
  angular_momentum += moment;
  if (!driven()) twist = Response(linear_momentum, angular_momentum);
}

void RigidGroup::Move(double dt_s) {
  moved_pivot_m = pivot_m + dt_s * twist.linear_m_s;
  end_angular_rad_s = twist.angular_rad_s;
  if (freedom != Freedom::kFree && freedom != Freedom::kPoint) {
    rotation = RotationStep(twist.angular_rad_s, dt_s).toRotationMatrix();
    return;
  }
  // Body frame: the axes of the world at the start of the step.
  const double angle = dt_s * twist.angular_rad_s.norm();
  int parts = std::clamp(static_cast<int>(std::min(angle / kAnglePerSubRotation, 1e6)) + 1, 1,
                         kMaxSubRotations);
  Quat turned;
  while (!TurnInParts(inverse_inertia, angular_momentum, dt_s, parts, &turned) &&
         parts < kMaxSubRotations) {
    parts *= 4;
  }
  rotation = turned.normalized().toRotationMatrix();
  end_angular_rad_s = rotation * (inverse_inertia * (rotation.transpose() * angular_momentum));
}

}  // namespace adhesim
