#include "server/service_context.h"

#include <absl/strings/str_cat.h>

#include "server/errors.h"

namespace adhesim {

absl::StatusOr<PeerCounter::Share> ServiceContext::TakeStream(const std::string& peer) {
  const std::uint32_t limit = sessions.limits().streams_per_peer;
  PeerCounter::Share share = streams.Take(PeerHost(peer), limit);
  if (share != nullptr) return share;
  return Error(Reason::kTooManyStreams,
               absl::StrCat("this peer has ", limit, " streams, more are not permitted"));
}

}  // namespace adhesim
