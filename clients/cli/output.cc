#include "clients/cli/output.h"

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>

namespace adhesim {

bool ColourOnStderr() {
  const char* no_colour = std::getenv("NO_COLOR");
  return isatty(STDERR_FILENO) == 1 && (no_colour == nullptr || *no_colour == '\0');
}

void PrintJson(const Json& json) {
  // Text from a file name may be any bytes: what is not UTF-8 is replaced, not thrown at.
  std::cout << json.dump(-1, ' ', false, Json::error_handler_t::replace) << std::endl;
}

namespace {

void MakeFolderOf(const std::string& path) {
  std::error_code ignored;
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty()) std::filesystem::create_directories(folder, ignored);
}

}  // namespace

absl::Status CheckWritable(const std::string& path) {
  MakeFolderOf(path);
  if (std::ofstream(path, std::ios::app)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("cannot write ", path));
}

absl::Status WriteTextFile(const std::string& path, const std::string& text) {
  MakeFolderOf(path);
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (file) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("cannot write ", path));
}

std::string Counted(std::size_t count, const std::string& one, const std::string& many) {
  return absl::StrCat(count, " ", count == 1 ? one : many);
}

Distribution Describe(std::vector<float> values) {
  std::sort(values.begin(), values.end());
  const auto rank = [&](double fraction) {
    const auto index =
        static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values.size())));
    return values[std::clamp<std::size_t>(index, 1, values.size()) - 1];
  };
  return {values.front(), rank(0.5), rank(0.99), values.back()};
}

}  // namespace adhesim
