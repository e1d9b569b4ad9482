#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "adhesim/v1/interaction_service.pb.h"
#include "server/hub.h"
#include "server/service_context.h"

namespace adhesim {

// One operator's stream, over whatever transport. Of each kind of message the newest waits to be
// sent: a slow operator gets fewer, never older.
//
// Receive() and Leave() on one thread at a time; everything else on any.
class OperatorStream final : public OperatorSink {
 public:
  // `wake` is called when Next() has something or the stream has ended: on any thread, perhaps with
  // the hub locked, but not with this stream's own lock. It must return quickly and must not call
  // the hub.
  OperatorStream(ServiceContext* context, std::function<void()> wake);
  ~OperatorStream() override { Leave(); }

  // A message of the client. An error ends the stream.
  absl::Status Receive(const v1::InteractRequest& request);
  // Puts the next message into `response`; false when there is none.
  bool Next(v1::InteractResponse* response);
  // Why the session has ended the stream; nothing while it goes on.
  std::optional<absl::Status> ended() const;
  // Lets go of the tool. May be called several times. `wake` is not called any more.
  void Leave();

  void Deliver(const v1::InteractResponse& response) override;
  void End(const absl::Status& why) override;

 private:
  absl::Status TakeControl(const v1::InteractRequest& request);
  void TakePose(const v1::ToolPose& message);
  void Refuse(const v1::ToolPose& message, const absl::Status& why);

  ServiceContext* const context_;
  const std::function<void()> wake_;
  // Written by the first Receive() only.
  std::shared_ptr<LiveSession> live_;
  int tool_ = 0;
  std::uint64_t operator_id_ = 0;

  mutable std::mutex mutex_;  // guards the rest
  std::optional<absl::Status> ended_;
  std::optional<v1::InteractResponse> control_taken_;
  std::optional<v1::InteractResponse> refused_;
  std::optional<v1::InteractResponse> heartbeat_;
  v1::InteractResponse feedback_;
  bool feedback_waits_ = false;
  std::uint64_t poses_superseded_ = 0;
  std::uint64_t poses_refused_ = 0;
  std::uint64_t feedback_superseded_ = 0;
};

}  // namespace adhesim
