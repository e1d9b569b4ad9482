#include "clients/cli/browser.h"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

namespace adhesim {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;

// How often `stop` is asked.
constexpr int kPollMs = 100;
// Longest message taken: a picture of 8192 x 8192 in base64 fits.
constexpr std::size_t kMostBytes = std::size_t{512} << 20;

// The path of a program; empty when there is none.
std::string FindProgram(const std::string& name) {
  if (name.find('/') != std::string::npos) return access(name.c_str(), X_OK) == 0 ? name : "";
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    std::string candidate = absl::StrCat(folder, "/", name);
    if (access(candidate.c_str(), X_OK) == 0 && !fs::is_directory(candidate)) return candidate;
  }
  return "";
}

// No flag names a GL: that would draw the whole page, not only its canvas, in software.
std::vector<std::string> Command(const std::string& program, const std::string& profile, int width,
                                 int height) {
  std::vector<std::string> command = {
      program, "--headless=new", "--remote-debugging-pipe",
      absl::StrCat("--user-data-dir=", profile), absl::StrCat("--window-size=", width, ",", height),
      "--no-first-run", "--no-default-browser-check", "--disable-background-networking",
      "--disable-component-update", "--disable-sync", "--disable-extensions", "--disable-breakpad",
      // Where shared memory is small, as in containers.
      "--disable-dev-shm-usage",
      // The page draws with WebGL, here without a GPU.
      "--enable-unsafe-swiftshader",
      // It talks to this machine's loopback only.
      "--no-proxy-server", "--hide-scrollbars", "--force-color-profile=srgb", "--mute-audio",
      "about:blank"};
  // Chromium's sandbox refuses to run as root.
  if (geteuid() == 0) command.push_back("--no-sandbox");
  return command;
}

// Our environment, with home and temporary files in the profile, so that nothing of it stays
// elsewhere.
std::vector<std::string> Environment(const std::string& profile) {
  std::vector<std::string> environment;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view text = *entry;
    if (!text.starts_with("HOME=") && !text.starts_with("XDG_") && !text.starts_with("TMPDIR=")) {
      environment.emplace_back(text);
    }
  }
  environment.push_back("HOME=" + profile);
  environment.push_back("TMPDIR=" + profile);
  return environment;
}

std::vector<char*> Pointers(std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  for (std::string& text : strings) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

// Two ends, both above the descriptors that the child is given, and closed by exec.
absl::Status MakePipe(int* read_end, int* write_end) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return absl::ErrnoToStatus(errno, "pipe");
  *read_end = fcntl(ends[0], F_DUPFD_CLOEXEC, 10);
  *write_end = fcntl(ends[1], F_DUPFD_CLOEXEC, 10);
  close(ends[0]);
  close(ends[1]);
  if (*read_end >= 0 && *write_end >= 0) return absl::OkStatus();
  return absl::ErrnoToStatus(errno, "pipe");
}

// Starts a program in a process group of its own, with the pipes at 3 and 4 and stderr in a file.
absl::StatusOr<pid_t> Spawn(std::vector<std::string> command, std::vector<std::string> environment,
                            int read_end, int write_end, const std::string& log) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, read_end, 3);
  posix_spawn_file_actions_adddup2(&actions, write_end, 4);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  // Ctrl-C in a terminal reaches this process only, and that ends the browser. Signals that we
  // block or ignore are the browser's own again.
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  posix_spawnattr_setpgroup(&attributes, 0);
  sigset_t none, defaults;
  sigemptyset(&none);
  sigemptyset(&defaults);
  for (const int signal : {SIGPIPE, SIGINT, SIGTERM}) sigaddset(&defaults, signal);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);

  pid_t process = -1;
  const int error = posix_spawn(&process, command[0].c_str(), &actions, &attributes,
                                Pointers(command).data(), Pointers(environment).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return absl::ErrnoToStatus(error, absl::StrCat("cannot start ", command[0]));
  return process;
}

// A write into the pipe of a browser that is gone shall fail, not kill us.
class IgnoreBrokenPipe {
 public:
  IgnoreBrokenPipe() : old_(std::signal(SIGPIPE, SIG_IGN)) {}
  ~IgnoreBrokenPipe() { std::signal(SIGPIPE, old_); }

 private:
  void (*old_)(int);
};

}  // namespace

Browser::Browser(const Options& options)
    : options_(options),
      deadline_(Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                   std::chrono::duration<double>(options.timeout_s))) {}

Browser::~Browser() { End(); }

absl::StatusOr<std::string> Browser::Find(const std::string& wanted) {
  if (!wanted.empty()) {
    const std::string found = FindProgram(wanted);
    if (!found.empty() && !fs::is_directory(found)) return found;
    return absl::NotFoundError(absl::StrCat("no program ", wanted));
  }
  for (const char* name : {"chromium", "chromium-browser", "google-chrome"}) {
    const std::string found = FindProgram(name);
    if (!found.empty()) return found;
  }
  return absl::NotFoundError(
      "pictures need a browser, and there is none on PATH: install the packages chromium and "
      "fonts-dejavu-core, or name one with --browser");
}

absl::StatusOr<std::unique_ptr<Browser>> Browser::Start(const Options& options) {
  std::unique_ptr<Browser> browser(new Browser(options));
  absl::Status status = browser->Launch();
  if (status.ok()) status = browser->AttachToPage();
  if (absl::IsInternal(status)) {
    return absl::InternalError(absl::StrCat(status.message(), browser->LastWords()));
  }
  if (!status.ok()) return status;
  return browser;
}

absl::Status Browser::Launch() {
  const absl::StatusOr<std::string> program = Find(options_.program);
  if (!program.ok()) return program.status();
  absl::StatusOr<std::unique_ptr<TemporaryDirectory>> profile = TemporaryDirectory::Make();
  if (!profile.ok()) return profile.status();
  profile_ = *std::move(profile);

  int its_input = -1, its_output = -1;
  absl::Status status = MakePipe(&its_input, &to_browser_);
  if (status.ok()) status = MakePipe(&from_browser_, &its_output);
  if (status.ok()) {
    const absl::StatusOr<pid_t> process =
        Spawn(Command(*program, profile_->path(), options_.width, options_.height),
              Environment(profile_->path()), its_input, its_output, profile_->path() + "/log");
    status = process.status();
    if (process.ok()) process_ = *process;
  }
  close(its_input);
  close(its_output);
  if (!status.ok()) return status;
  fcntl(to_browser_, F_SETFL, O_NONBLOCK);
  fcntl(from_browser_, F_SETFL, O_NONBLOCK);
  return absl::OkStatus();
}

absl::Status Browser::AttachToPage() {
  absl::StatusOr<Json> target = Call("Target.createTarget", {{"url", "about:blank"}});
  if (!target.ok()) return target.status();
  const absl::StatusOr<Json> attached = Call(
      "Target.attachToTarget", {{"targetId", target->value("targetId", "")}, {"flatten", true}});
  if (!attached.ok()) return attached.status();
  page_ = attached->value("sessionId", "");
  const Json size = {{"width", options_.width},
                     {"height", options_.height},
                     {"deviceScaleFactor", 1},
                     {"mobile", false}};
  for (const auto& [method, params] : {std::pair<const char*, Json>{"Page.enable", Json::object()},
                                       {"Runtime.enable", Json::object()},
                                       {"Log.enable", Json::object()},
                                       {"Emulation.setDeviceMetricsOverride", size}}) {
    const absl::StatusOr<Json> answer = Call(method, params);
    if (!answer.ok()) return answer.status();
  }
  return absl::OkStatus();
}

absl::Status Browser::Open(const std::string& url) {
  const absl::StatusOr<Json> answer = Call("Page.navigate", {{"url", url}});
  if (!answer.ok()) return answer.status();
  const std::string error = answer->value("errorText", "");
  if (!error.empty()) return absl::InternalError(absl::StrCat("cannot open ", url, ": ", error));
  return Evaluate(
             "new Promise(done => document.readyState === 'complete' ? done() : "
             "addEventListener('load', () => done()))")
      .status();
}

absl::StatusOr<Json> Browser::Evaluate(const std::string& expression) {
  const absl::StatusOr<Json> answer =
      Call("Runtime.evaluate",
           {{"expression", expression}, {"awaitPromise", true}, {"returnByValue", true}});
  if (!answer.ok()) return answer.status();
  if (!answer->contains("exceptionDetails")) {
    return answer->at("result").value("value", Json());
  }
  const Json& details = answer->at("exceptionDetails");
  const Json thrown = details.value("exception", Json::object());
  return absl::FailedPreconditionError(
      thrown.value("description", details.value("text", "an exception")));
}

absl::StatusOr<std::string> Browser::Screenshot() {
  const absl::StatusOr<Json> answer = Call("Page.captureScreenshot", {{"format", "png"}});
  if (!answer.ok()) return answer.status();
  std::string png;
  if (absl::Base64Unescape(answer->value("data", ""), &png) && !png.empty()) return png;
  return absl::InternalError("the browser's picture cannot be read");
}

absl::StatusOr<Json> Browser::Call(const std::string& method, Json params) {
  Json message = {{"id", ++calls_}, {"method", method}, {"params", std::move(params)}};
  if (!page_.empty()) message["sessionId"] = page_;
  const absl::Status sent = Send(message.dump());
  if (!sent.ok()) return sent;
  while (true) {
    absl::StatusOr<Json> answer = Receive();
    if (!answer.ok()) return answer.status();
    if (answer->value("id", std::int64_t{0}) != calls_) {
      NoteEvent(*answer);
      continue;
    }
    if (!answer->contains("error")) return answer->value("result", Json::object());
    return absl::InternalError(
        absl::StrCat(method, ": ", answer->at("error").value("message", "refused")));
  }
}

absl::Status Browser::Send(const std::string& message) {
  const IgnoreBrokenPipe ignore;
  const std::size_t size = message.size() + 1;  // with its zero byte
  for (std::size_t sent = 0; sent < size;) {
    const ssize_t count = write(to_browser_, message.c_str() + sent, size - sent);
    if (count > 0) {
      sent += count;
    } else if (errno == EAGAIN || errno == EINTR) {
      absl::Status status = Await(to_browser_, POLLOUT);
      if (!status.ok()) return status;
    } else {
      return absl::InternalError("the browser ended");
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<Json> Browser::Receive() {
  std::size_t searched = 0;
  while (true) {
    const std::size_t end = received_.find('\0', searched);
    if (end != std::string::npos) {
      const Json message = Json::parse(received_.begin(), received_.begin() + end, nullptr, false);
      received_.erase(0, end + 1);
      if (message.is_object()) return message;
      return absl::InternalError("the browser does not speak the DevTools protocol");
    }
    searched = received_.size();
    if (searched > kMostBytes) return absl::InternalError("the browser's answer is too long");
    const absl::Status status = Await(from_browser_, POLLIN);
    if (!status.ok()) return status;
    char bytes[65536];
    const ssize_t count = read(from_browser_, bytes, sizeof(bytes));
    if (count > 0) {
      received_.append(bytes, count);
    } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
      return absl::InternalError("the browser ended");
    }
  }
}

absl::Status Browser::Await(int descriptor, short events) {
  while (true) {
    if (options_.stop && options_.stop()) return absl::CancelledError("interrupted");
    if (Clock::now() >= deadline_) {
      return absl::DeadlineExceededError(
          absl::StrCat("the browser took longer than ", options_.timeout_s, " s"));
    }
    pollfd entry{descriptor, events, 0};
    if (poll(&entry, 1, kPollMs) > 0) return absl::OkStatus();
  }
}

void Browser::NoteEvent(const Json& event) {
  const std::string method = event.value("method", "");
  const Json params = event.value("params", Json::object());
  if (method == "Runtime.exceptionThrown") {
    const Json details = params.value("exceptionDetails", Json::object());
    page_errors_.push_back(details.value("exception", Json::object())
                               .value("description", details.value("text", "an exception")));
  } else if (method == "Runtime.consoleAPICalled" && params.value("type", "") == "error") {
    std::string text;
    for (const Json& argument : params.value("args", Json::array())) {
      absl::StrAppend(&text, text.empty() ? "" : " ",
                      argument.value("description", argument.value("value", Json()).dump()));
    }
    page_errors_.push_back(text);
  } else if (method == "Log.entryAdded") {
    const Json entry = params.value("entry", Json::object());
    if (entry.value("level", "") != "error") return;
    page_errors_.push_back(absl::StrCat(entry.value("text", ""), " ", entry.value("url", "")));
  }
}

void Browser::End() {
  if (to_browser_ >= 0) close(to_browser_);
  if (from_browser_ >= 0) close(from_browser_);
  if (process_ > 0) {
    // Nothing of it is kept, so that it need not end in order. What it started is of its group.
    kill(-process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
}

std::string Browser::LastWords() const {
  if (profile_ == nullptr) return "";
  std::ifstream file(profile_->path() + "/log");
  std::string words, line;
  while (std::getline(file, line)) words = line.empty() ? words : line;
  return words.empty() ? "" : absl::StrCat("; its last words: ", words);
}

}  // namespace adhesim
