#include "server/operator_stream.h"

#include <absl/strings/str_cat.h>

#include <string>
#include <utility>

#include "server/errors.h"
#include "server/pose_check.h"

namespace adhesim {

OperatorStream::OperatorStream(ServiceContext* context, std::function<void()> wake)
    : context_(context), wake_(std::move(wake)) {}

void OperatorStream::Deliver(const v1::InteractResponse& response) {
  {
    const std::lock_guard lock(mutex_);
    if (response.has_feedback()) {
      if (feedback_waits_) ++feedback_superseded_;
      feedback_ = response;
      feedback_waits_ = true;
    } else if (response.has_control_taken()) {
      control_taken_ = response;
    } else {
      heartbeat_ = response;
    }
  }
  wake_();
}

void OperatorStream::End(const absl::Status& why) {
  {
    const std::lock_guard lock(mutex_);
    if (!ended_) ended_ = why;
  }
  wake_();
}

std::optional<absl::Status> OperatorStream::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

absl::Status OperatorStream::Receive(const v1::InteractRequest& request) {
  const std::size_t bytes = request.ByteSizeLong();
  const std::uint32_t limit = context_->sessions.limits().stream_message_bytes;
  if (bytes > limit) {
    return Error(Reason::kMessageTooLarge,
                 absl::StrCat("a message of ", bytes, " bytes, permitted are ", limit));
  }
  if (live_ == nullptr) return TakeControl(request);
  if (request.has_take_control()) {
    return Error(Reason::kStreamStartedTwice, "only the first message may take control");
  }
  TakePose(request.pose());
  return absl::OkStatus();
}

void OperatorStream::Leave() {
  if (live_ != nullptr) live_->hub->RemoveOperator(this);
}

bool OperatorStream::Next(v1::InteractResponse* response) {
  const std::lock_guard lock(mutex_);
  if (control_taken_ || refused_ || heartbeat_) {
    std::optional<v1::InteractResponse>& waiting = control_taken_ ? control_taken_
                                                   : refused_     ? refused_
                                                                  : heartbeat_;
    *response = *std::move(waiting);
    waiting.reset();
    return true;
  }
  if (!feedback_waits_) return false;
  feedback_waits_ = false;
  response->Swap(&feedback_);
  v1::ToolFeedback* feedback = response->mutable_feedback();
  feedback->set_poses_superseded(poses_superseded_);
  feedback->set_poses_refused(poses_refused_);
  feedback->set_feedback_superseded(feedback_superseded_);
  feedback->set_server_sent_ns(MonotonicNs());
  return true;
}

absl::Status OperatorStream::TakeControl(const v1::InteractRequest& request) {
  if (!request.has_take_control()) {
    return Error(Reason::kStreamNotStarted, "the first message must take control of a tool");
  }
  const v1::TakeControl& wanted = request.take_control();
  absl::StatusOr<std::shared_ptr<LiveSession>> live = context_->sessions.Find(wanted.session());
  if (!live.ok()) return live.status();
  const absl::StatusOr<int> tool = (*live)->hub->FindTool(wanted.tool());
  if (!tool.ok()) return tool.status();
  tool_ = *tool;
  live_ = *std::move(live);
  const absl::StatusOr<std::uint64_t> id = live_->hub->AddOperator(wanted.tool(), this);
  if (!id.ok()) return id.status();
  operator_id_ = *id;
  live_->session->WakeObserver();
  return absl::OkStatus();
}

// A pose that cannot be used is answered and counted, and changes nothing.
void OperatorStream::TakePose(const v1::ToolPose& message) {
  absl::StatusOr<Pose> pose = Error(Reason::kPoseMissing, "the message has no pose");
  if (message.has_pose()) pose = CheckPose(message.pose());
  if (!pose.ok()) {
    Refuse(message, pose.status());
    return;
  }
  OperatorPose input;
  input.pose = *pose;
  input.operator_id = operator_id_;
  input.sequence = message.sequence();
  input.client_time_ns = message.client_time_ns();
  input.received_ns = MonotonicNs();
  const bool overtook = live_->session->PostPose(tool_, input);
  const std::lock_guard lock(mutex_);
  if (overtook) ++poses_superseded_;
}

void OperatorStream::Refuse(const v1::ToolPose& message, const absl::Status& why) {
  const Session::Snapshot now = live_->session->snapshot();
  {
    const std::lock_guard lock(mutex_);
    ++poses_refused_;
    refused_.emplace();
    refused_->set_session(live_->id);
    refused_->set_step(now.step);
    refused_->set_time_s(now.time_s);
    v1::PoseRefused* refused = refused_->mutable_pose_refused();
    refused->set_sequence(message.sequence());
    refused->set_reason(ReasonOf(why));
    refused->set_message(std::string(why.message()));
    refused->set_poses_refused(poses_refused_);
  }
  wake_();
}

}  // namespace adhesim
