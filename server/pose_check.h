#pragma once

#include <absl/status/statusor.h>

#include "adhesim/v1/frame.pb.h"
#include "core/model/geometry.h"

namespace adhesim {

// The pose of a message, its quaternion normalised. Errors: PoseNotFinite; PoseOutOfRange (a
// coordinate beyond 1000 m); PoseNotARotation (norm of the quaternion not 1 within 0.01). Does not
// judge jumps: the tool follows those slowly.
absl::StatusOr<Pose> CheckPose(const v1::Pose& message);

}  // namespace adhesim
