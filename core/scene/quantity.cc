#include "core/scene/quantity.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/scene/did_you_mean.h"

namespace adhesim {
namespace {

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

// Longer suffixes first: "_n_m" before "_m".
const std::vector<Dimension>& Dimensions() {
  static const std::vector<Dimension> kDimensions = {
      {"_nm_rad",
       "a torque per angle",
       {{"N m/rad", 0}, {"mN m/rad", -3}, {"N m/deg", 0, kDegreesPerRadian}}},
      {"_n_s_m", "a damping", {{"N s/m", 0}, {"mN s/m", -3}, {"kN s/m", 3}}},
      {"_m_s2", "an acceleration", {{"m/s^2", 0}, {"mm/s^2", -3}, {"cm/s^2", -2}, {"m/s2", 0}}},
      {"_rad_s", "an angular velocity", {{"rad/s", 0}, {"deg/s", 0, 1 / kDegreesPerRadian}}},
      {"_per_s", "a rate", {{"1/s", 0}, {"1/ms", 3}, {"1/min", 0, 1.0 / 60}}},
      {"_m_s", "a velocity", {{"m/s", 0}, {"mm/s", -3}, {"cm/s", -2}}},
      {"_n_m", "a stiffness", {{"N/m", 0}, {"mN/m", -3}, {"kN/m", 3}, {"N/mm", 3}}},
      {"_deg", "an angle", {{"deg", 0}, {"\u00b0", 0}, {"rad", 0, kDegreesPerRadian}}},
      {"_pa",
       "a pressure",
       {{"Pa", 0}, {"kPa", 3}, {"MPa", 6}, {"N/m^2", 0}, {"mmHg", 0, 133.322387415}}},
      {"_nm", "a torque", {{"N m", 0}, {"mN m", -3}, {"N mm", -3}}},
      {"_hz", "a frequency", {{"Hz", 0}, {"kHz", 3}, {"1/s", 0}}},
      {"_kg", "a mass", {{"kg", 0}, {"g", -3}, {"mg", -6}}},
      {"_m", "a length", {{"m", 0}, {"mm", -3}, {"cm", -2}, {"um", -6}, {"\u00b5m", -6}}},
      {"_s", "a time", {{"s", 0}, {"ms", -3}, {"us", -6}, {"min", 0, 60}}},
      {"_n", "a force", {{"N", 0}, {"mN", -3}, {"kN", 3}}},
  };
  return kDimensions;
}

std::size_t DigitsAt(absl::string_view text, std::size_t at) {
  std::size_t end = at;
  while (end < text.size() && absl::ascii_isdigit(text[end])) ++end;
  return end - at;
}

// Length of the decimal number that `text` starts with, and where its exponent begins; 0: none.
std::size_t NumberLength(absl::string_view text, std::size_t* mantissa_length) {
  std::size_t at = !text.empty() && (text[0] == '+' || text[0] == '-') ? 1 : 0;
  const std::size_t whole = DigitsAt(text, at);
  // "010" is octal to some readers of YAML and ten to others.
  if (whole > 1 && text[at] == '0') return 0;
  at += whole;
  std::size_t fraction = 0;
  if (at < text.size() && text[at] == '.') {
    fraction = DigitsAt(text, at + 1);
    at += 1 + fraction;
  }
  if (whole + fraction == 0) return 0;
  *mantissa_length = at;
  if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
    const std::size_t sign =
        at + 1 < text.size() && (text[at + 1] == '+' || text[at + 1] == '-') ? 1 : 0;
    const std::size_t digits = DigitsAt(text, at + 1 + sign);
    if (digits > 0) at += 1 + sign + digits;
  }
  return at;
}

// The number `text` = mantissa and exponent, times 10^power, correctly rounded.
absl::StatusOr<double> ToDouble(absl::string_view text, std::size_t mantissa_length, int power) {
  const absl::Status too_large = absl::InvalidArgumentError(absl::StrCat(
      Quoted(text), " cannot be represented: permitted are numbers of size 2.3e-308 to 1.7e308"));
  int exponent = 0;
  if (mantissa_length < text.size()) {
    absl::string_view digits = text.substr(mantissa_length + 1);
    if (digits[0] == '+') digits.remove_prefix(1);
    const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), exponent);
    if (parsed.ec != std::errc() || std::abs(exponent) > 100000) return too_large;
  }
  absl::string_view mantissa = text.substr(0, mantissa_length);
  if (mantissa[0] == '+') mantissa.remove_prefix(1);
  const std::string decimal = absl::StrCat(mantissa, "e", exponent + power);
  double value = 0;
  const auto parsed = std::from_chars(decimal.data(), decimal.data() + decimal.size(), value);
  if (parsed.ec != std::errc() || parsed.ptr != decimal.data() + decimal.size()) return too_large;
  return value;
}

// Symbols are compared with "*", "." and "·" read as a space: "N*s/m" is "N s/m".
std::string Normalised(absl::string_view symbol) {
  std::string text(symbol);
  std::replace(text.begin(), text.end(), '*', ' ');
  return text;
}

const Unit* FindUnit(const Dimension& dimension, absl::string_view symbol) {
  const std::string wanted = Normalised(symbol);
  for (const Unit& unit : dimension.units) {
    if (unit.symbol == wanted) return &unit;
  }
  return nullptr;
}

absl::Status NotANumber(absl::string_view text, const Dimension* dimension) {
  std::string permitted = "a finite decimal number";
  if (dimension != nullptr) {
    absl::StrAppend(&permitted, " in ", dimension->units[0].symbol, ", or a number and a unit (",
                    UnitList(*dimension), ")");
  }
  return absl::InvalidArgumentError(absl::StrCat("expected ", permitted, ", got ", Quoted(text)));
}

}  // namespace

const Dimension* DimensionOf(absl::string_view field_name) {
  for (const Dimension& dimension : Dimensions()) {
    if (absl::EndsWith(field_name, dimension.suffix)) return &dimension;
  }
  return nullptr;
}

std::string UnitList(const Dimension& dimension) {
  return absl::StrJoin(dimension.units, ", ", [](std::string* out, const Unit& unit) {
    absl::StrAppend(out, unit.symbol);
  });
}

absl::StatusOr<double> ParseQuantity(absl::string_view text, const Dimension* dimension) {
  text = absl::StripAsciiWhitespace(text);
  std::size_t mantissa_length = 0;
  const std::size_t length = NumberLength(text, &mantissa_length);
  if (length == 0) return NotANumber(text, dimension);
  const absl::string_view number = text.substr(0, length);
  const absl::string_view symbol = absl::StripLeadingAsciiWhitespace(text.substr(length));
  if (symbol.empty()) return ToDouble(number, mantissa_length, 0);

  // "1_000", "0x10", "1,5" and "1.2.3" are misspelt numbers, not numbers with a wrong unit.
  const char next = text[length];
  if (next == '_' || next == ',' || next == '.' || absl::ascii_isdigit(next) ||
      (number == "0" && next != ' ')) {
    return NotANumber(text, dimension);
  }
  if (dimension == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("expected a number without a unit, got ", Quoted(text)));
  }
  const Unit* unit = FindUnit(*dimension, symbol);
  if (unit == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(Quoted(symbol), " is not a unit of ",
                                                   dimension->name,
                                                   " here; permitted: ", UnitList(*dimension)));
  }
  absl::StatusOr<double> value = ToDouble(number, mantissa_length, unit->power);
  if (value.ok() && unit->factor != 1) *value *= unit->factor;
  if (value.ok() && !std::isfinite(*value)) return NotANumber(text, dimension);
  return value;
}

namespace {

template <typename Integer>
absl::StatusOr<Integer> ParseWhole(absl::string_view text, Integer min, Integer max) {
  text = absl::StripAsciiWhitespace(text);
  const std::size_t sign = !text.empty() && (text[0] == '+' || text[0] == '-') ? 1 : 0;
  const std::size_t digits = DigitsAt(text, sign);
  if (digits == 0 || sign + digits != text.size() || (digits > 1 && text[sign] == '0')) {
    return absl::InvalidArgumentError(absl::StrCat("expected a whole number, got ", Quoted(text)));
  }
  if (text[0] == '+') text.remove_prefix(1);
  Integer value = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  if (parsed.ec != std::errc() || parsed.ptr != text.data() + text.size() || value < min ||
      value > max) {
    return absl::InvalidArgumentError(absl::StrCat(
        Quoted(text), " is out of range: permitted are whole numbers from ", min, " to ", max));
  }
  return value;
}

}  // namespace

absl::StatusOr<std::int64_t> ParseInteger(absl::string_view text, std::int64_t min,
                                          std::int64_t max) {
  return ParseWhole<std::int64_t>(text, min, max);
}

absl::StatusOr<std::uint64_t> ParseUnsigned(absl::string_view text, std::uint64_t max) {
  return ParseWhole<std::uint64_t>(text, 0, max);
}

std::string NumberText(double value) {
  // Digits alone where they are few. YAML 1.1 takes a number with an exponent for a text unless it
  // has a point.
  const double size = std::abs(value);
  const bool fixed = value == 0 || (size >= 1e-6 && size < 1e9);
  char buffer[64];
  const auto format = fixed ? std::chars_format::fixed : std::chars_format::scientific;
  std::string text(buffer, std::to_chars(buffer, buffer + sizeof(buffer), value, format).ptr);
  if (const std::size_t e = text.find('e'); e != text.npos && text.find('.') == text.npos)
    text.insert(e, ".0");
  return text;
}

}  // namespace adhesim
