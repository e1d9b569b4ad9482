#pragma once

#include <absl/strings/string_view.h>

#include <span>
#include <string>

namespace adhesim {

// The candidate that `text` was probably meant to be: the one with the fewest edits, if they are
// few, or one that only adds words ("mass" -> "mass_kg"); empty when none is near.
std::string NearestName(absl::string_view text, std::span<const std::string> candidates);

// " (did you mean 'mass_kg'?)", or empty.
std::string DidYouMean(absl::string_view text, std::span<const std::string> candidates);

// `text` in single quotes, cut to a length that fits a message.
std::string Quoted(absl::string_view text);

}  // namespace adhesim
