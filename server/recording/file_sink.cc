#include "server/recording/file_sink.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>

namespace adhesim {

absl::StatusOr<ByteSink> OpenFileSink(const std::string& path, bool must_be_new) {
  const int flags = O_WRONLY | O_CREAT | O_CLOEXEC | (must_be_new ? O_EXCL : O_TRUNC);
  const int fd = open(path.c_str(), flags, 0644);
  if (fd < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': cannot be written: ", std::strerror(errno)));
  }
  // Closed with the last copy of the sink.
  const std::shared_ptr<const int> file(new int(fd), [](const int* owned) {
    close(*owned);
    delete owned;
  });
  return ByteSink([file, path](std::string_view bytes) -> absl::Status {
    while (!bytes.empty()) {
      const ssize_t written = write(*file, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) {
        return absl::DataLossError(
            absl::StrCat("'", path, "': the recording ends here: ", std::strerror(errno)));
      }
      bytes.remove_prefix(written);
    }
    return absl::OkStatus();
  });
}

}  // namespace adhesim
