#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <variant>

#include "adhesim/v1/connection.pb.h"
#include "server/operator_stream.h"
#include "server/service_context.h"
#include "server/session_calls.h"
#include "server/viewer_stream.h"

namespace adhesim {

// A client that has one connection for all it does (connection.proto): numbered streams, each of
// them one call of a service. Knows no sockets: it is given messages and gives messages.
//
// Everything that waits to be sent is bounded: by credits (frames), by the newest of each kind
// (feedback, heartbeats), by kMaxCalls (answers).
//
// Receive(), Next() and Leave() on one thread. Always held by a shared_ptr.
class ClientConnection : public std::enable_shared_from_this<ClientConnection> {
 public:
  static constexpr std::size_t kMaxStreams = 16;
  static constexpr std::size_t kMaxCalls = 64;  // under way, or answered and not yet sent

  // A serialised ServerMessage in pieces, to be sent one after the other: `shared` is the same for
  // all viewers and never copied. It may be null.
  struct Outgoing {
    std::string head;
    SharedBytes shared;
    std::string tail;
  };

  // `wake` is called when Next() has something: on any thread, perhaps with locks held. It must
  // return quickly and must not call back.
  ClientConnection(ServiceContext* context, SessionCalls* calls, std::string peer,
                   std::function<void()> wake);
  ~ClientConnection() { Leave(); }

  // A message of the client. What is wrong with one stream is told on that stream; an error ends
  // the connection. `held` is let go when the message has been dealt with.
  absl::Status Receive(std::string_view bytes, std::shared_ptr<void> held = nullptr);
  // The next message; false when there is none.
  bool Next(Outgoing* message);
  // The client is gone: everything it holds is let go. Answers that are there already can still be
  // taken with Next(). `wake` is not called any more.
  void Leave();

  // The last message of a connection.
  static std::string Farewell(const absl::Status& why);

 private:
  struct Stream {
    PeerCounter::Share share;
    std::variant<std::monostate, ViewerStream, OperatorStream> end;
  };
  struct Call {
    v1::ClientMessage request;
    v1::ServerMessage response;
    std::shared_ptr<void> held;
  };

  template <typename End, typename Request>
  void ToStream(std::uint32_t number, const Request& request, bool opens);
  absl::StatusOr<PeerCounter::Share> TakeStream() const;
  void StartCall(std::shared_ptr<void> held);
  template <typename Request, typename Response>
  void Dispatch(const std::shared_ptr<Call>& call, const Request& request, Response* response);
  void FinishCall(const std::shared_ptr<Call>& call, const absl::Status& status);
  // Whether the number means anything now.
  bool IsOpen(std::uint32_t number) const;
  // Ends whatever the number means, and says why.
  void EndNumber(std::uint32_t number, const absl::Status& why);
  void EndStreamsThatEnded();
  bool NextOfStream(std::uint32_t number, Stream* stream, Outgoing* message);

  ServiceContext* const context_;
  SessionCalls* const calls_;
  const std::string peer_;
  const std::function<void()> wake_;
  // Used again and again, since poses and feedback are many.
  v1::ClientMessage received_;
  v1::ServerMessage sent_;
  std::map<std::uint32_t, Stream> streams_;
  std::uint32_t highest_number_ = 0;  // of streams that were opened
  std::uint32_t last_served_ = 0;

  // Guards the rest. A standard mutex: thread sanitizers do not see through Abseil's as packaged.
  mutable std::mutex mutex_;
  std::map<std::uint32_t, std::shared_ptr<Call>> pending_;
  std::deque<std::string> answers_;
  bool left_ = false;
};

}  // namespace adhesim
