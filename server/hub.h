#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "adhesim/v1/interaction_service.pb.h"
#include "adhesim/v1/view_service.pb.h"
#include "core/model/model.h"
#include "server/encode.h"
#include "server/session.h"

namespace adhesim {

// An operator's end of a tool, of whatever transport. Called on the session's observer thread with
// the hub locked: must return quickly and must not call the hub.
class OperatorSink {
 public:
  virtual ~OperatorSink() = default;
  virtual void Deliver(const v1::InteractResponse& response) = 0;
  // Last call: the session has ended, or cannot go on.
  virtual void End(const absl::Status& why) = 0;
};

// A message for viewers, serialised once for all of them.
using SharedBytes = std::shared_ptr<const std::string>;

// A viewer's end, likewise. `frames_dropped` is the viewer's own count, a field of WatchResponse
// that is not in `message` (serialised fields may be appended).
class ViewerSink {
 public:
  virtual ~ViewerSink() = default;
  virtual void Deliver(const SharedBytes& message, std::uint64_t frames_dropped) = 0;
  // A heartbeat may be left out when one is still waiting to be sent.
  virtual void DeliverHeartbeat(const SharedBytes& message, std::uint64_t frames_dropped) = 0;
  virtual void End(const absl::Status& why) = 0;
};

// Distributes one session's frames to its operators and viewers.
//
// A frame is made and serialised at most once for each format, and only when some viewer is due.
// A viewer is due when its own rate says so, it has not seen the newest frame, and fewer than
// `credits` frames are under way to it. A viewer without credit loses the frame: when it
// acknowledges, it gets the newest. (Measured: without credits, gRPC and TCP buffer seconds of
// small frames for a slow viewer.)
class Hub : public SessionObserver {
 public:
  struct ViewerOptions {
    double max_rate_hz = 60;
    FrameFormat format;
    std::uint32_t credits = 2;  // 1..8
  };

  // `model` outlives the hub's last use: it is the session's.
  Hub(std::string session_id, const Model& model);

  // ToolNotFound, ToolTaken, SessionFrozen, SessionDeleted. Gives the operator's id, unique within
  // the session.
  absl::StatusOr<std::uint64_t> AddOperator(const std::string& tool, OperatorSink* sink);
  // After it, the sink is not called again. Also when it was never added.
  void RemoveOperator(OperatorSink* sink);
  // The tool's number. ToolNotFound.
  absl::StatusOr<int> FindTool(const std::string& tool) const;

  // SessionFrozen, SessionDeleted.
  absl::Status AddViewer(const ViewerOptions& options, ViewerSink* sink);
  void RemoveViewer(ViewerSink* sink);
  // `frames`: how many of its frames the viewer is done with, of all it was sent. True when that
  // says more than the last time: the viewer may be due.
  bool Acknowledge(ViewerSink* sink, std::uint64_t frames);

  // Heartbeats say from now on that the server is going away.
  void AnnounceDraining();

  std::uint32_t viewers() const;
  std::vector<std::string> operated_tools() const;

  void OnFrame(const SessionFrame& frame, bool fresh) override;
  void OnHeartbeat(const SessionFrame& frame) override;
  void OnEnd(const absl::Status& why) override;

 private:
  struct Operator {
    OperatorSink* sink = nullptr;  // null: nobody
    std::uint64_t id = 0;
    bool greeted = false;
  };
  struct Viewer {
    ViewerOptions options;
    bool greeted = false;
    std::uint64_t seen = 0;  // number of the newest frame it was sent or lost
    std::uint64_t sent = 0;  // frames
    std::uint64_t acknowledged = 0;
    std::uint64_t dropped = 0;
    std::int64_t due_ns = 0;
  };

  void DeliverFeedback(const SessionFrame& frame, int tool);
  void DeliverFrame(const SessionFrame& frame, ViewerSink* sink, Viewer* viewer,
                    std::map<FrameFormat, SharedBytes>* encoded);
  bool IsDue(const Viewer& viewer, std::int64_t now_ns) const;
  void CountLost(Viewer* viewer, std::int64_t now_ns) const;
  SharedBytes Serialise(const v1::WatchResponse& response) const;
  void EndAll(const absl::Status& why);
  void FillHeartbeat(const SessionFrame& frame, v1::Heartbeat* message) const;
  std::vector<std::string> ListOperatedTools() const;
  template <typename Response>
  void Stamp(const SessionFrame& frame, Response* response) const;

  const std::string session_id_;
  const Model& model_;

  // Guards the rest. A standard mutex: thread sanitizers do not see through Abseil's as packaged.
  mutable std::mutex mutex_;
  std::vector<Operator> operators_;  // [#tools]
  std::map<ViewerSink*, Viewer> viewers_;
  std::uint64_t next_operator_id_ = 1;
  std::uint64_t frame_number_ = 0;
  bool draining_ = false;
  absl::Status refusal_;  // why nobody may join, or OK
  // Filled again and again, so that a frame allocates little.
  v1::InteractResponse feedback_;
  v1::WatchResponse frame_;
};

}  // namespace adhesim
