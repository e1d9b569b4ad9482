#pragma once

#include <atomic>

namespace adhesim {

// From now on SIGINT and SIGTERM ask to stop, by what is returned, instead of ending the program.
const std::atomic<bool>& StopOnSignals();
// One of them has asked.
bool StopRequested();

}  // namespace adhesim
