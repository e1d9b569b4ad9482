#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <string>

namespace adhesim {

// The bytes of a regular file (not a directory, pipe or device, on which reading could block) of at
// most `max_bytes`. Errors name the file.
absl::StatusOr<std::string> ReadFile(const std::string& path, std::size_t max_bytes);

// The ending of a file's name in small letters, without the dot: "obj"; of "a.inr.gz": "gz".
std::string Extension(const std::string& path);

}  // namespace adhesim
