#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include <cstddef>
#include <string>

namespace adhesim {

// True when the bytes begin like gzip data.
bool IsGzip(absl::string_view bytes);

// Decompresses gzip data; stops after `max_bytes` without an error (the caller asks for one more
// than it can use).
absl::StatusOr<std::string> Inflate(absl::string_view gzip, std::size_t max_bytes);

}  // namespace adhesim
