#pragma once

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

#include <cstdint>
#include <optional>
#include <string>

namespace adhesim {

// What the HTTP port permits and says, without sockets.

// Who may ask. `host` and `origin` are header fields ("" when absent), `listen` is where the server
// listens. A page of another site must not reach the server through its visitor's browser: neither
// by its own name (Origin), nor by a name that it lets resolve to this machine (Host; DNS
// rebinding). With `any_host`, servers in a trusted network, Host is not looked at. HostRefused,
// OriginRefused.
absl::Status CheckHostAndOrigin(absl::string_view host, absl::string_view origin,
                                const std::string& listen, bool any_host);

// The name of "/v1/recordings/NAME" when it is one that a recording can have: letters, digits,
// ".", "_", "-", ending in ".mcap", not beginning with ".".
std::optional<std::string> RecordingName(absl::string_view path);

// Of a file: the bytes first..last, both included.
struct ByteRange {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
};
enum class RangeKind { kWhole, kPart, kUnsatisfiable };
// What a Range header ("" when absent) asks for of a file of `size` bytes. Several ranges, and what
// is no range at all, ask for the whole file (RFC 9110, 14.2).
RangeKind ParseRange(absl::string_view header, std::uint64_t size, ByteRange* range);

// Whether an If-None-Match header names the tag.
bool MatchesEtag(absl::string_view header, absl::string_view etag);

// The Content-Security-Policy of the page: nothing from elsewhere, and WebSockets to this host
// only. Styles may be inline, since the page's controls write theirs so.
std::string ContentSecurityPolicy(absl::string_view host);

// How long browsers keep a file of the page: names under /assets/ change with the contents.
absl::string_view CacheControl(absl::string_view path);

}  // namespace adhesim
