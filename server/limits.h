#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace adhesim {

// What the server refuses to exceed.
struct Limits {
  std::uint32_t sessions = 64;
  std::uint32_t sessions_per_peer = 32;
  std::uint32_t streams_per_peer = 256;
  std::uint32_t connections_per_peer = 256;       // of the HTTP port
  std::uint64_t particles = 200'000;              // of a session
  std::uint32_t request_bytes = 16 << 20;         // scenes
  std::uint32_t stream_message_bytes = 64 << 10;  // poses and acknowledgements
};

// The host of a peer as gRPC writes it: "ipv4:10.0.0.7:5123" and all its other ports are one peer.
std::string PeerHost(const std::string& peer);

// Counts what each peer holds. Thread-safe.
class PeerCounter {
 public:
  // One of the peer's share, given back when the last copy goes. Null: the peer has `limit`
  // already.
  using Share = std::shared_ptr<void>;
  Share Take(const std::string& host, std::uint32_t limit);
  std::uint32_t total() const;

 private:
  // Outlives the counter when shares do.
  struct Counts {
    mutable std::mutex mutex;  // guards the rest
    std::map<std::string, std::uint32_t> by_host;
    std::uint32_t total = 0;
  };
  std::shared_ptr<Counts> counts_ = std::make_shared<Counts>();
};

}  // namespace adhesim
