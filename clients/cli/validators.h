#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace adhesim {

// A finite number in [min, max]. CLI::Range lets NaN through: it is neither below nor above.
inline CLI::Validator Between(double min, double max) {
  const std::string permitted = CLI::detail::to_string(min) + " to " + CLI::detail::to_string(max);
  return CLI::Validator(
      [min, max, permitted](const std::string& text) -> std::string {
        double value = 0;
        if (CLI::detail::lexical_cast(text, value) && value >= min && value <= max) return {};
        return "'" + text + "' is not permitted (a number from " + permitted + ")";
      },
      "FLOAT in [" + permitted + "]");
}

// A file to write: an option in its place is a forgotten name, not one.
inline CLI::Validator OutputFile() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        if (text.rfind("--", 0) != 0) return {};
        return "'" + text + "' is not permitted (a file's name; ./" + text + " if that is one)";
      },
      "");
}

}  // namespace adhesim
