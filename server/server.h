#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <memory>
#include <string>

#include "server/limits.h"
#include "server/listen.h"
#include "server/recording_source.h"
#include "server/scene_source.h"
#include "server/session_calls.h"

namespace adhesim {

// The service on its ports.
class Server {
 public:
  struct Options {
    std::string listen = "127.0.0.1:50051";  // HOST:PORT; port 0: a free one
    bool insecure_listen = false;            // permits addresses that other machines reach
    std::string http;                        // HOST:PORT of the page and WebSockets; empty: none
    bool realtime = true;                    // false: threads stay in the plain class
    std::string version;
    Limits limits;
    RecordingSource recordings;  // empty: nothing is recorded
  };

  // Errors: InvalidArgument for an address that is not loopback without `insecure_listen`;
  // Unavailable when it cannot be bound (taken, not ours).
  static absl::StatusOr<std::unique_ptr<Server>> Start(const Options& options, SceneSource scenes);
  // Shutdown(0).
  ~Server();

  // Where it listens: HOST:PORT with the port that was picked.
  const std::string& address() const { return address_; }
  // Likewise for HTTP; empty: nowhere.
  const std::string& http_address() const { return http_address_; }
  // "fifo", "short slice", "plain".
  std::string realtime_class() const;
  bool memory_locked() const;

  // Says that it is going away (health, streams, CreateSession), waits up to `grace_s` for streams
  // to end (or until
  // `*hurry`), then ends streams and sessions. Returns when nothing is left.
  void Shutdown(double grace_s, const std::atomic<bool>* hurry = nullptr);

 private:
  struct Parts;  // keeps gRPC out of this header

  explicit Server(std::unique_ptr<Parts> parts);

  std::unique_ptr<Parts> parts_;
  std::string address_;
  std::string http_address_;
};

}  // namespace adhesim
