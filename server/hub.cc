#include "server/hub.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <utility>

#include "server/encode.h"
#include "server/errors.h"

namespace adhesim {
namespace {

std::int64_t PeriodNs(const Hub::ViewerOptions& options) {
  return static_cast<std::int64_t>(1e9 / options.max_rate_hz);
}

}  // namespace

Hub::Hub(std::string session_id, const Model& model)
    : session_id_(std::move(session_id)), model_(model), operators_(model.tools.size()) {}

absl::StatusOr<int> Hub::FindTool(const std::string& tool) const {
  std::string names;
  for (std::size_t i = 0; i < model_.tools.size(); ++i) {
    if (model_.tools[i].name == tool) return static_cast<int>(i);
    absl::StrAppend(&names, names.empty() ? "" : ", ", model_.tools[i].name);
  }
  return Error(Reason::kToolNotFound,
               absl::StrCat("no tool \"", tool, "\" in session ", session_id_,
                            names.empty() ? "; it has none" : "; there is ", names));
}

absl::StatusOr<std::uint64_t> Hub::AddOperator(const std::string& tool, OperatorSink* sink) {
  const absl::StatusOr<int> index = FindTool(tool);
  if (!index.ok()) return index.status();
  const std::lock_guard lock(mutex_);
  if (!refusal_.ok()) return refusal_;
  Operator& seat = operators_[*index];
  if (seat.sink != nullptr) {
    return Error(Reason::kToolTaken, absl::StrCat("tool \"", tool, "\" of session ", session_id_,
                                                  " has an operator already"));
  }
  seat = Operator{sink, next_operator_id_++, false};
  return seat.id;
}

void Hub::RemoveOperator(OperatorSink* sink) {
  const std::lock_guard lock(mutex_);
  for (Operator& seat : operators_) {
    if (seat.sink == sink) seat = Operator{};
  }
}

absl::Status Hub::AddViewer(const ViewerOptions& options, ViewerSink* sink) {
  const std::lock_guard lock(mutex_);
  if (!refusal_.ok()) return refusal_;
  Viewer viewer;
  viewer.options = options;
  viewers_[sink] = viewer;
  return absl::OkStatus();
}

void Hub::RemoveViewer(ViewerSink* sink) {
  const std::lock_guard lock(mutex_);
  viewers_.erase(sink);
}

bool Hub::Acknowledge(ViewerSink* sink, std::uint64_t frames) {
  const std::lock_guard lock(mutex_);
  const auto found = viewers_.find(sink);
  if (found == viewers_.end()) return false;
  Viewer& viewer = found->second;
  // Never back, and never more than was sent.
  const std::uint64_t before = viewer.acknowledged;
  viewer.acknowledged = std::max(before, std::min(frames, viewer.sent));
  return viewer.acknowledged > before;
}

void Hub::AnnounceDraining() {
  const std::lock_guard lock(mutex_);
  draining_ = true;
}

std::uint32_t Hub::viewers() const {
  const std::lock_guard lock(mutex_);
  return viewers_.size();
}

std::vector<std::string> Hub::operated_tools() const {
  const std::lock_guard lock(mutex_);
  return ListOperatedTools();
}

std::vector<std::string> Hub::ListOperatedTools() const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < operators_.size(); ++i) {
    if (operators_[i].sink != nullptr) names.push_back(model_.tools[i].name);
  }
  return names;
}

template <typename Response>
void Hub::Stamp(const SessionFrame& frame, Response* response) const {
  response->set_session(session_id_);
  response->set_step(frame.frame.step);
  response->set_time_s(frame.frame.time_s);
}

SharedBytes Hub::Serialise(const v1::WatchResponse& response) const {
  return std::make_shared<const std::string>(response.SerializeAsString());
}

void Hub::OnFrame(const SessionFrame& frame, bool fresh) {
  const std::lock_guard lock(mutex_);
  if (frame.state == v1::SESSION_STATE_FROZEN) {
    if (!fresh) return;
    EndAll(Error(Reason::kSessionFrozen,
                 absl::StrCat("session ", session_id_, " is frozen since step ", frame.frame.step,
                              ": ", frame.frozen_because, "; reset or delete it")));
    return;
  }
  if (fresh && absl::IsFailedPrecondition(refusal_)) refusal_ = absl::OkStatus();  // reset
  if (fresh) ++frame_number_;
  for (std::size_t i = 0; i < operators_.size(); ++i) {
    Operator& seat = operators_[i];
    if (seat.sink == nullptr) continue;
    if (!seat.greeted) {
      seat.greeted = true;
      v1::InteractResponse response;
      Stamp(frame, &response);
      EncodeTool(frame.frame.tools[i], frame.target_jumps[i],
                 response.mutable_control_taken()->mutable_tool());
      response.mutable_control_taken()->set_rate_hz(1.0 / model_.dt_s);
      seat.sink->Deliver(response);
    }
    if (fresh) DeliverFeedback(frame, static_cast<int>(i));
  }
  const std::int64_t now_ns = MonotonicNs();
  std::map<FrameFormat, SharedBytes> encoded;
  for (auto& [sink, viewer] : viewers_) {
    if (!viewer.greeted) {
      viewer.greeted = true;
      v1::WatchResponse response;
      Stamp(frame, &response);
      EncodeTopology(model_, response.mutable_topology());
      sink->Deliver(Serialise(response), 0);
    }
    if (!IsDue(viewer, now_ns)) continue;
    if (viewer.sent - viewer.acknowledged < viewer.options.credits) {
      DeliverFrame(frame, sink, &viewer, &encoded);
    } else if (fresh) {
      CountLost(&viewer, now_ns);
    }
  }
}

void Hub::DeliverFeedback(const SessionFrame& frame, int tool) {
  const Operator& seat = operators_[tool];
  const OperatorPose& pose = frame.newest_pose[tool];
  Stamp(frame, &feedback_);
  v1::ToolFeedback* feedback = feedback_.mutable_feedback();
  feedback->Clear();
  EncodeTool(frame.frame.tools[tool], frame.target_jumps[tool], feedback->mutable_tool());
  EncodeTiming(frame.timing, feedback->mutable_timing());
  if (pose.operator_id == seat.id) {
    feedback->set_sequence(pose.sequence);
    feedback->set_client_time_ns(pose.client_time_ns);
    feedback->set_server_received_ns(pose.received_ns);
  }
  seat.sink->Deliver(feedback_);
}

bool Hub::IsDue(const Viewer& viewer, std::int64_t now_ns) const {
  if (viewer.seen == frame_number_) return false;
  return viewer.options.max_rate_hz * model_.dt_s >= 1 || now_ns >= viewer.due_ns;
}

// The viewer has no credit. It stays due, so that the newest frame goes out as soon as it has; each
// further period loses it one.
void Hub::CountLost(Viewer* viewer, std::int64_t now_ns) const {
  if (now_ns < viewer->due_ns + PeriodNs(viewer->options)) return;
  ++viewer->dropped;
  viewer->due_ns = now_ns;
}

void Hub::DeliverFrame(const SessionFrame& frame, ViewerSink* sink, Viewer* viewer,
                       std::map<FrameFormat, SharedBytes>* encoded) {
  SharedBytes& bytes = (*encoded)[viewer->options.format];
  if (bytes == nullptr) {
    Stamp(frame, &frame_);
    EncodeFrame(frame, viewer->options.format, frame_.mutable_frame());
    bytes = Serialise(frame_);
  }
  viewer->seen = frame_number_;
  ++viewer->sent;
  // On a grid, so that the mean rate is the one asked for; a grid that fell behind starts anew.
  const std::int64_t now_ns = MonotonicNs();
  const std::int64_t period_ns = PeriodNs(viewer->options);
  viewer->due_ns = std::max(viewer->due_ns, now_ns - period_ns) + period_ns;
  sink->Deliver(bytes, viewer->dropped);
}

void Hub::FillHeartbeat(const SessionFrame& frame, v1::Heartbeat* message) const {
  EncodeHeartbeat(frame, draining_, message);
  message->set_viewers(viewers_.size());
  for (const std::string& tool : ListOperatedTools()) message->add_operated_tools(tool);
}

void Hub::OnHeartbeat(const SessionFrame& frame) {
  const std::lock_guard lock(mutex_);
  v1::InteractResponse to_operators;
  Stamp(frame, &to_operators);
  FillHeartbeat(frame, to_operators.mutable_heartbeat());
  for (const Operator& seat : operators_) {
    if (seat.sink != nullptr && seat.greeted) seat.sink->Deliver(to_operators);
  }
  v1::WatchResponse to_viewers;
  Stamp(frame, &to_viewers);
  FillHeartbeat(frame, to_viewers.mutable_heartbeat());
  const SharedBytes bytes = Serialise(to_viewers);
  for (const auto& [sink, viewer] : viewers_) {
    if (viewer.greeted) sink->DeliverHeartbeat(bytes, viewer.dropped);
  }
}

void Hub::OnEnd(const absl::Status& why) {
  const std::lock_guard lock(mutex_);
  EndAll(why);
}

void Hub::EndAll(const absl::Status& why) {
  refusal_ = why;
  for (Operator& seat : operators_) {
    if (seat.sink != nullptr) seat.sink->End(why);
    seat = Operator{};
  }
  for (auto& [sink, viewer] : viewers_) sink->End(why);
  viewers_.clear();
}

}  // namespace adhesim
