#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "adhesim/v1/view_service.pb.h"
#include "server/hub.h"
#include "server/service_context.h"

namespace adhesim {

// One viewer's stream, over whatever transport. Frames wait for as long as credits allow (the hub
// sees to that); a heartbeat waits alone.
//
// Receive() and Leave() on one thread at a time; everything else on any.
class ViewerStream final : public ViewerSink {
 public:
  // A serialised WatchResponse in two pieces: what is the same for all viewers, and the viewer's
  // own fields. (In the wire format, fields of a message can be concatenated.)
  struct Outgoing {
    SharedBytes shared;
    std::string own;
  };

  // `wake` as in OperatorStream.
  ViewerStream(ServiceContext* context, std::function<void()> wake);
  ~ViewerStream() override { Leave(); }

  // A message of the client. An error ends the stream.
  absl::Status Receive(const v1::WatchRequest& request);
  // Puts the next message into `response`; false when there is none.
  bool Next(Outgoing* response);
  // Why the session has ended the stream; nothing while it goes on.
  std::optional<absl::Status> ended() const;
  // Stops watching. May be called several times. `wake` is not called any more.
  void Leave();

  void Deliver(const SharedBytes& message, std::uint64_t frames_dropped) override;
  void DeliverHeartbeat(const SharedBytes& message, std::uint64_t frames_dropped) override;
  void End(const absl::Status& why) override;

 private:
  // A message as it waits to be sent.
  struct Waiting {
    SharedBytes bytes;
    std::uint64_t frames_dropped = 0;
  };

  absl::Status StartWatching(const v1::WatchRequest& request);

  ServiceContext* const context_;
  const std::function<void()> wake_;
  // Written by the first Receive() only.
  std::shared_ptr<LiveSession> live_;

  mutable std::mutex mutex_;  // guards the rest
  std::optional<absl::Status> ended_;
  std::deque<Waiting> waiting_;
  Waiting heartbeat_;
};

}  // namespace adhesim
