#include "server/limits.h"

namespace adhesim {

std::string PeerHost(const std::string& peer) {
  const bool has_port = peer.starts_with("ipv4:") || peer.starts_with("ipv6:");
  return has_port ? peer.substr(0, peer.rfind(':')) : peer;
}

PeerCounter::Share PeerCounter::Take(const std::string& host, std::uint32_t limit) {
  const std::lock_guard lock(counts_->mutex);
  std::uint32_t& count = counts_->by_host[host];
  if (count >= limit) return nullptr;
  ++count;
  ++counts_->total;
  // The pointer itself means nothing; its deleter gives the share back.
  return Share(counts_.get(), [counts = counts_, host](void*) {
    const std::lock_guard lock(counts->mutex);
    --counts->total;
    if (--counts->by_host[host] == 0) counts->by_host.erase(host);
  });
}

std::uint32_t PeerCounter::total() const {
  const std::lock_guard lock(counts_->mutex);
  return counts_->total;
}

}  // namespace adhesim
