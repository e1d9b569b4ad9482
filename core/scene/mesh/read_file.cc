#include "core/scene/mesh/read_file.h"

#include <absl/status/status.h>
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <filesystem>
#include <fstream>
#include <system_error>

namespace adhesim {

absl::StatusOr<std::string> ReadFile(const std::string& path, std::size_t max_bytes) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat("'", path, "': no such file"));
  }
  if (!std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': not a regular file"));
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::PermissionDeniedError(absl::StrCat("'", path, "': cannot be opened"));
  file.seekg(0, std::ios::end);
  const auto size = static_cast<std::streamoff>(file.tellg());
  file.seekg(0);
  if (size < 0) return absl::DataLossError(absl::StrCat("'", path, "': cannot be read"));
  if (size == 0) return absl::InvalidArgumentError(absl::StrCat("'", path, "': the file is empty"));
  if (static_cast<std::size_t>(size) > max_bytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': ", size, " bytes; at most ", max_bytes, " are permitted"));
  }
  std::string bytes(static_cast<std::size_t>(size), '\0');
  file.read(bytes.data(), size);
  if (file.gcount() != size) {
    return absl::DataLossError(absl::StrCat("'", path, "': cannot be read to its end"));
  }
  return bytes;
}

std::string Extension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  if (!extension.empty()) extension.erase(0, 1);
  return absl::AsciiStrToLower(extension);
}

}  // namespace adhesim
