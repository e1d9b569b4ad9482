#include "server/listen.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

namespace adhesim {

// gRPC itself takes what it can and serves elsewhere.
absl::Status CheckListen(const std::string& option, const std::string& listen,
                         bool insecure_listen) {
  if (listen.starts_with("unix:")) return absl::OkStatus();
  const std::size_t colon = listen.rfind(':');
  const std::string port = colon == std::string::npos ? "" : listen.substr(colon + 1);
  const bool digits =
      !port.empty() && port.size() <= 5 &&
      std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (colon == 0 || !digits || std::stoi(port) > 65535) {
    return absl::InvalidArgumentError(
        absl::StrCat(option, " ", listen,
                     ": not an address and a port (HOST:PORT, port 0 to 65535; 0 picks one)"));
  }
  if (IsLoopback(listen) || insecure_listen) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      listen,
      " can be reached from other machines, and nothing here asks who they are "
      "or encrypts what they send: use 127.0.0.1, or --insecure-listen in a network you trust"));
}

bool IsLoopback(const std::string& listen) {
  if (listen.starts_with("unix:")) return true;
  const std::string host = HostOf(listen);
  // "127." alone would let the name 127.example.org through.
  const bool v4 = host.starts_with("127.") && host.find_first_not_of("0123456789.") == host.npos;
  return v4 || host == "localhost" || host == "[::1]";
}

std::string HostOf(const std::string& listen) { return listen.substr(0, listen.rfind(':')); }

}  // namespace adhesim
