#pragma once

#include <absl/status/status.h>

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace adhesim {

// JSON objects keep the order in which their fields are written.
using Json = nlohmann::ordered_json;

// Whether messages on stderr may be coloured: a terminal, and NO_COLOR is not set.
bool ColourOnStderr();

// One object to stdout, on one line.
void PrintJson(const Json& json);

// Whether a file can be written, making the folders above it and, where there is none, the file:
// before what takes long. Errors: InvalidArgument.
absl::Status CheckWritable(const std::string& path);

// Writes a file, making the folders above it. Errors: InvalidArgument.
absl::Status WriteTextFile(const std::string& path, const std::string& text);

// "1 body", "2 bodies".
std::string Counted(std::size_t count, const std::string& one, const std::string& many);

struct Distribution {
  double min = 0, median = 0, p99 = 0, max = 0;
};

// Of at least one value; percentiles are values that occurred (the nearest rank).
Distribution Describe(std::vector<float> values);

}  // namespace adhesim
