#pragma once

#include <absl/status/status.h>

#include <string>

namespace adhesim {

// Whether a server may listen there: "HOST:PORT" with a port of 0 to 65535, or "unix:PATH", and
// loopback unless `insecure_listen`. `option` names it in the error (InvalidArgument).
absl::Status CheckListen(const std::string& option, const std::string& listen,
                         bool insecure_listen);

// True for 127.0.0.0/8, localhost, [::1] and unix sockets.
bool IsLoopback(const std::string& listen);

// "HOST" of "HOST:PORT", brackets included.
std::string HostOf(const std::string& listen);

}  // namespace adhesim
