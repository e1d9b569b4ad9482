#pragma once

#include "server/limits.h"
#include "server/sessions.h"

namespace adhesim {

// What the services share. Outlives them.
struct ServiceContext {
  Sessions& sessions;
  PeerCounter streams;  // open ones
};

}  // namespace adhesim
