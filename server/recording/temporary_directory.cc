#include "server/recording/temporary_directory.h"

#include <absl/strings/str_cat.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <thread>
#include <utility>

namespace adhesim {
namespace {

namespace fs = std::filesystem;

// Where temporary files go. A browser makes the socket org.chromium.Chromium.XXXXXX/SingletonSocket
// in its directory, and crashes when the path of that has more than the 107 bytes which a socket's
// may have.
std::string Parent() {
  constexpr std::size_t kLongest =
      107 - sizeof("/adhesim-XXXXXX/org.chromium.Chromium.XXXXXX/SingletonSocket");
  std::error_code error;
  const std::string directory = fs::temp_directory_path(error).string();
  return error || directory.size() > kLongest ? "/tmp" : directory;
}

}  // namespace

absl::StatusOr<std::unique_ptr<TemporaryDirectory>> TemporaryDirectory::Make() {
  const std::string parent = Parent();
  std::string path = parent + "/adhesim-XXXXXX";
  if (mkdtemp(path.data()) == nullptr) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot make a directory in ", parent));
  }
  return std::unique_ptr<TemporaryDirectory>(new TemporaryDirectory(std::move(path)));
}

TemporaryDirectory::~TemporaryDirectory() {
  // Processes that were killed a moment ago may still be writing.
  std::error_code error;
  for (int i = 0; i < 50; ++i) {
    fs::remove_all(path_, error);
    if (!fs::exists(path_, error)) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace adhesim
