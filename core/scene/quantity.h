#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include <cstdint>
#include <string>
#include <vector>

namespace adhesim {

// A unit that may be written after a number: value in SI = number * factor * 10^power.
struct Unit {
  absl::string_view symbol;
  int power;
  double factor = 1;
};

// What a field measures, known from the end of its name ("radius_m").
struct Dimension {
  absl::string_view suffix;  // "_m"
  absl::string_view name;    // "a length"
  std::vector<Unit> units;   // the field's own unit first
};

// The dimension of a field; null when its name ends in no unit.
const Dimension* DimensionOf(absl::string_view field_name);

// "m, mm, cm, um": for messages.
std::string UnitList(const Dimension& dimension);

// A finite decimal number, with a unit if `dimension` is not null: "0.018", "18 mm", "-3e2 kPa".
// The same decimal value gives the same bits whichever unit it is written in. Errors
// (InvalidArgument) say what is permitted.
absl::StatusOr<double> ParseQuantity(absl::string_view text, const Dimension* dimension);

// A whole number in [min, max].
absl::StatusOr<std::int64_t> ParseInteger(absl::string_view text, std::int64_t min,
                                          std::int64_t max);
absl::StatusOr<std::uint64_t> ParseUnsigned(absl::string_view text, std::uint64_t max);

// The shortest decimal number that reads back as the same bits, in YAML as in JSON.
std::string NumberText(double value);

}  // namespace adhesim
