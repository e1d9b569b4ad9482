#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/recording/temporary_directory.h"

namespace adhesim {

// A headless Chromium of our own with one page, spoken to in the Chrome DevTools Protocol over two
// pipes: JSON messages that end with a zero byte, ours into its descriptor 3, its into ours from
// its descriptor 4 (chromium/src/content/browser/devtools/devtools_pipe_handler.cc). No port is
// opened, and a browser whose pipe is closed ends by itself: it does not outlive this process,
// however that ends. Not for several threads.
class Browser {
 public:
  struct Options {
    std::string program =
        "";  // empty: the first of chromium, chromium-browser, google-chrome on PATH
    int width = 1280, height = 720;  // of the page, pixels
    double timeout_s = 60;           // of everything that is done with it, together
    // May be empty; when it is true, what is under way is cancelled.
    std::function<bool()> stop = nullptr;
  };

  // The path of the browser's program. Errors: NotFound, naming what to install.
  static absl::StatusOr<std::string> Find(const std::string& program);
  // Errors: NotFound without a browser; Internal when it ends before it answers, with its last
  // words; else as Call.
  static absl::StatusOr<std::unique_ptr<Browser>> Start(const Options& options);
  // Ends it with everything that it started and removes its profile.
  ~Browser();
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  // Opens an address in the page and waits until it is loaded with all that its document names.
  absl::Status Open(const std::string& url);
  // The value of an expression in the page; a promise is awaited. Errors: FailedPrecondition with
  // the message of what it throws.
  absl::StatusOr<nlohmann::json> Evaluate(const std::string& expression);
  // The page as it is painted, a PNG file's bytes.
  absl::StatusOr<std::string> Screenshot();
  // What the page complained of: exceptions that nobody caught, and errors on its console.
  const std::vector<std::string>& page_errors() const { return page_errors_; }

 private:
  explicit Browser(const Options& options);

  absl::Status Launch();
  absl::Status AttachToPage();
  // One command of the protocol and its answer. Errors: Cancelled when `stop` says so;
  // DeadlineExceeded; Unavailable when the browser ends; Internal with the protocol's own.
  absl::StatusOr<nlohmann::json> Call(const std::string& method,
                                      nlohmann::json params = nlohmann::json::object());
  absl::Status Send(const std::string& message);
  absl::StatusOr<nlohmann::json> Receive();
  // Until the pipe can be read or written, or there is a reason to give up.
  absl::Status Await(int descriptor, short events);
  void NoteEvent(const nlohmann::json& event);
  void End();
  std::string LastWords() const;

  const Options options_;
  const std::chrono::steady_clock::time_point deadline_;
  std::unique_ptr<TemporaryDirectory> profile_;
  pid_t process_ = -1;  // and leader of a process group
  int to_browser_ = -1, from_browser_ = -1;
  std::string received_;  // not yet a whole message
  std::string page_;      // the protocol's session of the page, empty before there is one
  std::int64_t calls_ = 0;
  std::vector<std::string> page_errors_;
};

}  // namespace adhesim
