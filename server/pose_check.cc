#include "server/pose_check.h"

#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/errors.h"

namespace adhesim {
namespace {

constexpr double kMaxCoordinateM = 1000;
constexpr double kNormTolerance = 0.01;

}  // namespace

absl::StatusOr<Pose> CheckPose(const v1::Pose& message) {
  const Vec3 position_m(message.x_m(), message.y_m(), message.z_m());
  const Quat orientation(message.qw(), message.qx(), message.qy(), message.qz());
  if (!position_m.allFinite() || !orientation.coeffs().allFinite()) {
    return Error(Reason::kPoseNotFinite,
                 absl::StrCat("pose (", message.x_m(), ", ", message.y_m(), ", ", message.z_m(),
                              ") m, (", message.qw(), ", ", message.qx(), ", ", message.qy(), ", ",
                              message.qz(), "): every number must be finite"));
  }
  if (position_m.cwiseAbs().maxCoeff() > kMaxCoordinateM) {
    return Error(Reason::kPoseOutOfRange,
                 absl::StrCat("position (", message.x_m(), ", ", message.y_m(), ", ", message.z_m(),
                              ") m, permitted are -1000 to 1000"));
  }
  const double norm = orientation.norm();
  if (!(std::abs(norm - 1) <= kNormTolerance)) {
    return Error(Reason::kPoseNotARotation,
                 absl::StrCat("norm of the quaternion is ", norm, ", permitted are 0.99 to 1.01"));
  }
  return Pose{position_m, orientation.normalized()};
}

}  // namespace adhesim
