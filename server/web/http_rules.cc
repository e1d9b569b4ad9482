#include "server/web/http_rules.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <vector>

#include "server/errors.h"
#include "server/listen.h"

namespace adhesim {
namespace {

// A host name or address and perhaps a port; nothing that could end a header or a directive.
bool IsPlainHost(absl::string_view host) {
  return !host.empty() && std::all_of(host.begin(), host.end(), [](char c) {
    return absl::ascii_isalnum(c) || c == '.' || c == '-' || c == ':' || c == '[' || c == ']';
  });
}

// "localhost:8080" and "localhost" as HOST:PORT.
std::string WithPort(absl::string_view host) {
  const std::size_t colon = host.rfind(':');
  const bool has_port = colon != host.npos && host.find(']', colon) == host.npos;
  return has_port ? std::string(host) : absl::StrCat(host, ":80");
}

bool ParseNumber(absl::string_view text, std::uint64_t* number) {
  const bool digits = !text.empty() && std::all_of(text.begin(), text.end(), absl::ascii_isdigit);
  return digits && absl::SimpleAtoi(text, number);
}

}  // namespace

absl::Status CheckHostAndOrigin(absl::string_view host, absl::string_view origin,
                                const std::string& listen, bool any_host) {
  const std::string name = WithPort(absl::AsciiStrToLower(host));
  const bool known = IsPlainHost(host) && (any_host || IsLoopback(name) ||
                                           HostOf(name) == absl::AsciiStrToLower(HostOf(listen)));
  if (!known) {
    return Error(
        Reason::kHostRefused,
        absl::StrCat("Host is \"", IsPlainHost(host) ? host : "",
                     "\", permitted are localhost, 127.0.0.1, [::1] and ", HostOf(listen)));
  }
  if (origin.empty()) return absl::OkStatus();
  absl::string_view site = origin;
  if (!absl::ConsumePrefix(&site, "http://")) absl::ConsumePrefix(&site, "https://");
  if (absl::EqualsIgnoreCase(site, host)) return absl::OkStatus();
  return Error(Reason::kOriginRefused,
               absl::StrCat("a page of another site may not use this server; permitted is the "
                            "Origin http://",
                            host));
}

std::optional<std::string> RecordingName(absl::string_view path) {
  if (!absl::ConsumePrefix(&path, "/v1/recordings/")) return std::nullopt;
  const bool plain = std::all_of(path.begin(), path.end(), [](char c) {
    return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-';
  });
  const bool fits = plain && path.size() <= 255 && absl::EndsWith(path, ".mcap") && path[0] != '.';
  return fits ? std::optional<std::string>(path) : std::nullopt;
}

RangeKind ParseRange(absl::string_view header, std::uint64_t size, ByteRange* range) {
  *range = {0, size == 0 ? 0 : size - 1};
  if (!absl::ConsumePrefix(&header, "bytes=")) return RangeKind::kWhole;
  const std::vector<absl::string_view> ends = absl::StrSplit(header, '-');
  if (ends.size() != 2) return RangeKind::kWhole;
  std::uint64_t first = 0, last = 0;
  const bool has_first = ParseNumber(ends[0], &first);
  const bool has_last = ParseNumber(ends[1], &last);
  if ((!has_first && !ends[0].empty()) || (!has_last && !ends[1].empty())) {
    return RangeKind::kWhole;
  }
  if (!has_first && !has_last) return RangeKind::kWhole;
  if (has_first && has_last && last < first) return RangeKind::kWhole;
  if (!has_first) {  // the last so many bytes
    if (last == 0 || size == 0) return RangeKind::kUnsatisfiable;
    range->first = size - std::min(last, size);
    return RangeKind::kPart;
  }
  if (first >= size) return RangeKind::kUnsatisfiable;
  range->first = first;
  if (has_last) range->last = std::min(last, size - 1);
  return RangeKind::kPart;
}

bool MatchesEtag(absl::string_view header, absl::string_view etag) {
  for (absl::string_view tag : absl::StrSplit(header, ',')) {
    tag = absl::StripAsciiWhitespace(tag);
    absl::ConsumePrefix(&tag, "W/");
    if (tag == "*" || tag == etag) return true;
  }
  return false;
}

std::string ContentSecurityPolicy(absl::string_view host) {
  const std::string sockets =
      IsPlainHost(host) ? absl::StrCat(" ws://", host, " wss://", host) : "";
  return absl::StrCat(
      "default-src 'self'; connect-src 'self'", sockets,
      "; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; font-src 'self' data:; "
      "worker-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'none'; "
      "frame-ancestors 'none'");
}

absl::string_view CacheControl(absl::string_view path) {
  return absl::StartsWith(path, "/assets/") ? "public, max-age=31536000, immutable" : "no-cache";
}

}  // namespace adhesim
