#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/service_context.h"
#include "server/session_calls.h"

namespace adhesim {

// The HTTP port:
//   /                     the viewer's page (page_files.h)
//   /v1/ws                WebSocket, subprotocol "adhesim.v1.pb": connection.proto, binary messages
//   /v1/recordings/NAME   a recording's file, whole or a Range of it
//   /healthz              200 "ok"; 503 "draining" when the server is going away
// Everything else is 404. Requests of other sites' pages are refused (http_rules.h).
//
// One thread of its own, in the plain class, does everything, so that no client can keep a session
// waiting. Boost stays in the sources and in beast_*.h.
class WebServer {
 public:
  // How long a client may take, s. Tests make them shorter.
  struct Patience {
    double request_s = 10;   // for a whole HTTP request, and between two of them
    double handshake_s = 5;  // of a WebSocket
    double idle_s = 10;  // without a sign of life on a WebSocket; it is asked for one at half time
    double message_s = 10;  // from the first byte of a message to its last
    double write_s = 5;     // until it has taken a message
  };
  struct Options {
    std::string listen;            // HOST:PORT; port 0: a free one
    bool insecure_listen = false;  // permits addresses that other machines reach, and any Host
    Patience patience;
  };

  // `context` and `calls` outlive the server. Errors: InvalidArgument, Unavailable, as
  // Server::Start.
  static absl::StatusOr<std::unique_ptr<WebServer>> Start(const Options& options,
                                                          ServiceContext* context,
                                                          SessionCalls* calls);
  // Stop().
  ~WebServer();

  // HOST:PORT with the port that was picked.
  const std::string& address() const { return address_; }

  // Sends what waits to be sent, says good-bye to every client, and ends; within about a second,
  // whatever the clients do.
  void Stop();

 private:
  struct Parts;

  explicit WebServer(std::unique_ptr<Parts> parts);

  std::unique_ptr<Parts> parts_;
  std::string address_;
};

}  // namespace adhesim
