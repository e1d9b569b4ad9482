#include "server/recording/file_sink.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <string_view>

#include "server/recording/mcap_format.h"

namespace adhesim {

namespace {

// What is at the path may be something else than its user meant: a recording may replace nothing
// but a recording.
absl::Status CheckReplaceable(int fd) {
  struct stat about {};
  if (fstat(fd, &about) != 0) return absl::InvalidArgumentError(std::strerror(errno));
  if (!S_ISREG(about.st_mode)) return absl::InvalidArgumentError("not a regular file");
  if (about.st_size == 0) return absl::OkStatus();
  char begin[mcap::kMagic.size()];
  const ssize_t got = pread(fd, begin, sizeof(begin), 0);
  if (got == sizeof(begin) && std::string_view(begin, got) == mcap::kMagic) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "exists and is not a recording; permitted: a new file, or a recording to overwrite");
}

}  // namespace

absl::StatusOr<ByteSink> OpenFileSink(const std::string& path, bool must_be_new) {
  // Without blocking: opening a pipe would wait for its reader.
  const int flags =
      O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOCTTY | (must_be_new ? O_EXCL : 0);
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
  if (absl::Status status = CheckReplaceable(fd); !status.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", status.message()));
  }
  if (ftruncate(fd, 0) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': cannot be emptied: ", std::strerror(errno)));
  }
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
