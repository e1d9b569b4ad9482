#include "server/interaction_service.h"

#include <absl/strings/str_cat.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "server/errors.h"
#include "server/ordered_stream.h"
#include "server/pose_check.h"

namespace adhesim {
namespace {

// One operator's stream. Of each kind of message the newest waits to be sent: a slow operator gets
// fewer, never older.
class OperatorStream final : public OrderedStream<v1::InteractRequest, v1::InteractResponse>,
                             public OperatorSink {
 public:
  OperatorStream(ServiceContext* context, const std::string& peer) : context_(context) {
    const Limits& limits = context_->sessions.limits();
    share_ = context_->streams.Take(PeerHost(peer), limits.streams_per_peer);
    if (share_ == nullptr) {
      Close(Error(Reason::kTooManyStreams, absl::StrCat("this peer has ", limits.streams_per_peer,
                                                        " streams, more are not permitted")));
      return;
    }
    Start();
  }

  void Deliver(const v1::InteractResponse& response) override {
    absl::MutexLock lock(&mutex_);
    if (response.has_feedback()) {
      if (feedback_waits_) ++feedback_superseded_;
      feedback_ = response;
      feedback_waits_ = true;
    } else if (response.has_control_taken()) {
      control_taken_ = response;
    } else {
      heartbeat_ = response;
    }
    Continue();
  }

  void End(const absl::Status& why) override { Close(why); }

 protected:
  absl::Status Receive(const v1::InteractRequest& request) override {
    const std::size_t bytes = request.ByteSizeLong();
    if (bytes > context_->sessions.limits().stream_message_bytes) {
      return Error(Reason::kMessageTooLarge,
                   absl::StrCat("a message of ", bytes, " bytes, permitted are ",
                                context_->sessions.limits().stream_message_bytes));
    }
    if (live_ == nullptr) return TakeControl(request);
    if (request.has_take_control()) {
      return Error(Reason::kStreamStartedTwice, "only the first message may take control");
    }
    TakePose(request.pose());
    return absl::OkStatus();
  }

  void Leave() override {
    if (live_ != nullptr) live_->hub->RemoveOperator(this);
  }

  bool Next(v1::InteractResponse* response) override {
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

 private:
  absl::Status TakeControl(const v1::InteractRequest& request) {
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
  void TakePose(const v1::ToolPose& message) {
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
    absl::MutexLock lock(&mutex_);
    if (overtook) ++poses_superseded_;
  }

  void Refuse(const v1::ToolPose& message, const absl::Status& why) {
    const Session::Snapshot now = live_->session->snapshot();
    absl::MutexLock lock(&mutex_);
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
    Continue();
  }

  ServiceContext* const context_;
  PeerCounter::Share share_;
  // Written by the first Receive() only.
  std::shared_ptr<LiveSession> live_;
  int tool_ = 0;
  std::uint64_t operator_id_ = 0;

  std::optional<v1::InteractResponse> control_taken_ ABSL_GUARDED_BY(mutex_);
  std::optional<v1::InteractResponse> refused_ ABSL_GUARDED_BY(mutex_);
  std::optional<v1::InteractResponse> heartbeat_ ABSL_GUARDED_BY(mutex_);
  v1::InteractResponse feedback_ ABSL_GUARDED_BY(mutex_);
  bool feedback_waits_ ABSL_GUARDED_BY(mutex_) = false;
  std::uint64_t poses_superseded_ ABSL_GUARDED_BY(mutex_) = 0;
  std::uint64_t poses_refused_ ABSL_GUARDED_BY(mutex_) = 0;
  std::uint64_t feedback_superseded_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace

grpc::ServerBidiReactor<v1::InteractRequest, v1::InteractResponse>* InteractionService::Interact(
    grpc::CallbackServerContext* call) {
  return new OperatorStream(context_, call->peer());
}

}  // namespace adhesim
