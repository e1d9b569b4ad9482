#include "clients/cli/stop_signals.h"

#include <signal.h>

namespace adhesim {
namespace {

// Written by the signal handler.
std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free);

}  // namespace

const std::atomic<bool>& StopOnSignals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = true; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return stop_requested;
}

bool StopRequested() { return stop_requested; }

}  // namespace adhesim
