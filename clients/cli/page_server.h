#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

namespace adhesim {

// Serves the page, and the recordings of a directory to it, on a free port of this machine's
// loopback. There are no scenes and no sessions.
class PageServer {
 public:
  // FailedPrecondition: the program was built without the page.
  static absl::Status HasPage();
  static absl::StatusOr<std::unique_ptr<PageServer>> Start(const std::string& recordings);
  ~PageServer();

  // HOST:PORT.
  const std::string& address() const;

 private:
  struct Parts;
  explicit PageServer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace adhesim
