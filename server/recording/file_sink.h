#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/recording/mcap_writer.h"

namespace adhesim {

// Appends to a file that it makes, or empties when a recording is there already and it need not be
// new. InvalidArgument: the file cannot be opened, is not a regular one, or holds something else.
absl::StatusOr<ByteSink> OpenFileSink(const std::string& path, bool must_be_new);

}  // namespace adhesim
