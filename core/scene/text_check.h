#pragma once

#include <absl/strings/string_view.h>

#include <optional>

#include "core/scene/problem.h"

namespace adhesim {

// What makes a text unfit to be a scene before it is parsed, with its place: too long (over 4 MiB),
// not UTF-8, or control characters (a binary file).
std::optional<Problem> CheckText(absl::string_view text);

}  // namespace adhesim
