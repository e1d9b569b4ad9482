#include "server/errors.h"

#include <absl/strings/cord.h>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace adhesim {
namespace {

constexpr char kTypeUrl[] = "type.googleapis.com/google.rpc.Status";
constexpr int kRetryAfterS = 5;

struct Entry {
  const char* name;
  absl::StatusCode code;
};

Entry Find(Reason reason) {
  using Code = absl::StatusCode;
  switch (reason) {
    case Reason::kArgumentInvalid:
      return {"ARGUMENT_INVALID", Code::kInvalidArgument};
    case Reason::kSceneInvalid:
      return {"SCENE_INVALID", Code::kInvalidArgument};
    case Reason::kSceneNotFound:
      return {"SCENE_NOT_FOUND", Code::kNotFound};
    case Reason::kSceneTooLarge:
      return {"SCENE_TOO_LARGE", Code::kResourceExhausted};
    case Reason::kSessionNotFound:
      return {"SESSION_NOT_FOUND", Code::kNotFound};
    case Reason::kSessionDeleted:
      return {"SESSION_DELETED", Code::kAborted};
    case Reason::kSessionFrozen:
      return {"SESSION_FROZEN", Code::kFailedPrecondition};
    case Reason::kSessionNotPaused:
      return {"SESSION_NOT_PAUSED", Code::kFailedPrecondition};
    case Reason::kToolNotFound:
      return {"TOOL_NOT_FOUND", Code::kNotFound};
    case Reason::kToolTaken:
      return {"TOOL_TAKEN", Code::kAlreadyExists};
    case Reason::kRecordingNotFound:
      return {"RECORDING_NOT_FOUND", Code::kNotFound};
    case Reason::kStreamNotStarted:
      return {"STREAM_NOT_STARTED", Code::kInvalidArgument};
    case Reason::kStreamStartedTwice:
      return {"STREAM_STARTED_TWICE", Code::kInvalidArgument};
    case Reason::kStreamInUse:
      return {"STREAM_IN_USE", Code::kInvalidArgument};
    case Reason::kMessageTooLarge:
      return {"MESSAGE_TOO_LARGE", Code::kResourceExhausted};
    case Reason::kMessageTooSlow:
      return {"MESSAGE_TOO_SLOW", Code::kDeadlineExceeded};
    case Reason::kHostRefused:
      return {"HOST_REFUSED", Code::kPermissionDenied};
    case Reason::kOriginRefused:
      return {"ORIGIN_REFUSED", Code::kPermissionDenied};
    case Reason::kTooManySessions:
      return {"TOO_MANY_SESSIONS", Code::kResourceExhausted};
    case Reason::kTooManyStreams:
      return {"TOO_MANY_STREAMS", Code::kResourceExhausted};
    case Reason::kTooManyConnections:
      return {"TOO_MANY_CONNECTIONS", Code::kResourceExhausted};
    case Reason::kTooManyRequests:
      return {"TOO_MANY_REQUESTS", Code::kResourceExhausted};
    case Reason::kDraining:
      return {"DRAINING", Code::kUnavailable};
    case Reason::kPoseMissing:
      return {"POSE_MISSING", Code::kInvalidArgument};
    case Reason::kPoseNotFinite:
      return {"POSE_NOT_FINITE", Code::kInvalidArgument};
    case Reason::kPoseNotARotation:
      return {"POSE_NOT_A_ROTATION", Code::kInvalidArgument};
    case Reason::kPoseOutOfRange:
      return {"POSE_OUT_OF_RANGE", Code::kInvalidArgument};
    case Reason::kInternal:
      return {"INTERNAL", Code::kInternal};
  }
  return {"INTERNAL", Code::kInternal};
}

google::rpc::Status Details(const absl::Status& status, const char* reason) {
  google::rpc::Status details;
  details.set_code(static_cast<int>(status.code()));
  details.set_message(std::string(status.message()));
  google::rpc::ErrorInfo info;
  info.set_reason(reason);
  info.set_domain("adhesim");
  details.add_details()->PackFrom(info);
  return details;
}

}  // namespace

const char* ReasonName(Reason reason) { return Find(reason).name; }

absl::Status Error(Reason reason, const std::string& message,
                   const std::vector<FieldViolation>& violations) {
  const Entry entry = Find(reason);
  absl::Status status(entry.code, message);
  google::rpc::Status details = Details(status, entry.name);
  if (!violations.empty()) {
    google::rpc::BadRequest request;
    for (const FieldViolation& violation : violations) {
      auto* field = request.add_field_violations();
      field->set_field(violation.field);
      field->set_description(violation.description);
    }
    details.add_details()->PackFrom(request);
  }
  if (reason == Reason::kDraining) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_seconds(kRetryAfterS);
    details.add_details()->PackFrom(retry);
  }
  status.SetPayload(kTypeUrl, absl::Cord(details.SerializeAsString()));
  return status;
}

std::string ReasonOf(const absl::Status& status) {
  google::rpc::Status details;
  google::rpc::ErrorInfo info;
  const bool found = details.ParseFromString(ErrorDetails(status)) && details.details_size() > 0 &&
                     details.details(0).UnpackTo(&info);
  return found ? info.reason() : ReasonName(Reason::kInternal);
}

std::string ErrorDetails(const absl::Status& status) {
  if (status.ok()) return "";
  const auto payload = status.GetPayload(kTypeUrl);
  if (payload) return std::string(*payload);
  return Details(status, "INTERNAL").SerializeAsString();
}

}  // namespace adhesim
