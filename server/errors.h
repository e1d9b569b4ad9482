#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

namespace adhesim {

// Every reason for which the service refuses something: the one catalogue. Each has one status code
// (errors.cc).
enum class Reason {
  kArgumentInvalid,
  kSceneInvalid,
  kSceneNotFound,
  kSceneTooLarge,
  kSessionNotFound,
  kSessionDeleted,
  kSessionFrozen,
  kSessionNotPaused,
  kToolNotFound,
  kToolTaken,
  kRecordingNotFound,
  kStreamNotStarted,
  kStreamStartedTwice,
  kStreamInUse,
  kMessageTooLarge,
  kMessageTooSlow,
  kHostRefused,
  kOriginRefused,
  kTooManySessions,
  kTooManyStreams,
  kTooManyConnections,
  kTooManyRequests,
  kDraining,
  kPoseMissing,
  kPoseNotFinite,
  kPoseNotARotation,
  kPoseOutOfRange,
  kInternal,
};

// "SESSION_NOT_FOUND".
const char* ReasonName(Reason reason);

// A wrong field of a request.
struct FieldViolation {
  std::string field;        // path: "scene.bodies[1].icosphere.radius_m"
  std::string description;  // what is wrong, the value, what is permitted
};

// An error for a client. `message` says what, the value, what is permitted. It carries a
// google.rpc.Status with one ErrorInfo (domain "adhesim"), a BadRequest when fields are wrong, and
// a RetryInfo for kDraining.
absl::Status Error(Reason reason, const std::string& message,
                   const std::vector<FieldViolation>& violations = {});

// The reason of a status that Error() made; "INTERNAL" of any other.
std::string ReasonOf(const absl::Status& status);

// The google.rpc.Status of a status, as bytes, for the trailer `grpc-status-details-bin`. A status
// that Error() did not make gets one with the reason INTERNAL.
std::string ErrorDetails(const absl::Status& status);

}  // namespace adhesim
