#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/limits.h"
#include "server/sessions.h"

namespace adhesim {

// What the services share, over whatever transport. Outlives them.
struct ServiceContext {
  Sessions& sessions;
  PeerCounter streams;  // open ones

  // One of the streams that a peer may have open. TooManyStreams.
  absl::StatusOr<PeerCounter::Share> TakeStream(const std::string& peer);
};

}  // namespace adhesim
