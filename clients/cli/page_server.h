#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

namespace adhesim {

// Serves the page, and one recording to it, on a free port of this machine's loopback. There are no
// scenes and no sessions.
class PageServer {
 public:
  // FailedPrecondition: the program was built without the page.
  static absl::Status HasPage();
  // `recording`: a file, no link.
  static absl::StatusOr<std::unique_ptr<PageServer>> Start(const std::string& recording);
  ~PageServer();

  // Where the page is, with the recording open: http://HOST:PORT/?recording=...
  std::string url() const;

 private:
  struct Parts;
  explicit PageServer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace adhesim
