#include "clients/cli/browser.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

namespace adhesim {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Temporary directories are made here, so that what stays behind can be seen.
class BrowserTest : public testing::Test {
 protected:
  BrowserTest() {
    // Asked once: it follows the variable that is set here.
    static const std::string temporary = testing::TempDir();
    std::string name = temporary + "browser_XXXXXX";
    directory_ = mkdtemp(name.data());
    setenv("TMPDIR", directory_.c_str(), 1);
  }
  ~BrowserTest() override {
    EXPECT_TRUE(fs::is_empty(directory_) || program_written_) << "something stays behind";
    fs::remove_all(directory_);
    // No child is left, not even one that ended and was not waited for.
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
    EXPECT_EQ(errno, ECHILD);
  }
  // A script in place of the browser.
  std::string Script(const std::string& text) {
    const fs::path path = directory_ / "script";
    std::ofstream(path) << "#!/bin/sh\n" << text << "\n";
    fs::permissions(path, fs::perms::owner_all);
    program_written_ = true;
    return path.string();
  }

  fs::path directory_;

 private:
  bool program_written_ = false;
};

// A page that answers late, complains, and is 64 x 32 pixels of red when it is painted.
constexpr char kPage[] =
    "data:text/html,<body style='margin:0;background:rgb(255,0,0)'><script>"
    "window.later = () => new Promise(done => requestAnimationFrame(() => done({step: 7})));"
    "console.error('a complaint');"
    "setTimeout(() => { throw new Error('nobody catches this'); }, 0);"
    "</script>";

TEST_F(BrowserTest, EvaluatesAwaitsPaintsAndHearsComplaints) {
  auto browser = Browser::Start({.width = 64, .height = 32});
  ASSERT_TRUE(browser.ok()) << browser.status();
  ASSERT_TRUE((*browser)->Open(kPage).ok());
  const auto later = (*browser)->Evaluate("later()");
  ASSERT_TRUE(later.ok()) << later.status();
  EXPECT_EQ((*later)["step"], 7);
  const auto thrown = (*browser)->Evaluate("(() => { throw new Error('thrown'); })()");
  EXPECT_EQ(thrown.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(thrown.status().message()), HasSubstr("thrown"));

  const auto png = (*browser)->Screenshot();
  ASSERT_TRUE(png.ok()) << png.status();
  // The PNG signature, then in the header chunk width and height as big-endian 32 bits.
  ASSERT_GT(png->size(), 33u);
  EXPECT_EQ(png->substr(1, 3), "PNG");
  EXPECT_EQ(png->at(19), 64);
  EXPECT_EQ(png->at(23), 32);
  EXPECT_THAT((*browser)->page_errors(),
              ElementsAre(HasSubstr("a complaint"), HasSubstr("nobody catches this")));
}

TEST_F(BrowserTest, NamesThePackageWhenThereIsNoBrowser) {
  const std::string path = std::getenv("PATH");
  setenv("PATH", directory_.c_str(), 1);
  const auto browser = Browser::Start({});
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(browser.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(browser.status().message()), HasSubstr("chromium"));
}

TEST_F(BrowserTest, TellsTheLastWordsOfABrowserThatEnds) {
  const auto browser = Browser::Start({.program = Script("echo no display today >&2; exit 3")});
  EXPECT_EQ(browser.status().code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(browser.status().message()), HasSubstr("no display today"));
}

TEST_F(BrowserTest, RefusesAProgramThatSpeaksSomethingElse) {
  const auto browser = Browser::Start({.program = Script("printf 'hello\\0' >&4; sleep 60")});
  EXPECT_EQ(browser.status().code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(browser.status().message()), HasSubstr("DevTools"));
}

TEST_F(BrowserTest, GivesUpOnASilentBrowserAndKillsWhatItStarted) {
  const fs::path pid_file = directory_ / "pid";
  const auto browser = Browser::Start(
      {.program = Script("trap '' TERM HUP; sleep 600 & echo $! >" + pid_file.string() + "; wait"),
       .timeout_s = 0.5});
  EXPECT_EQ(browser.status().code(), absl::StatusCode::kDeadlineExceeded);
  pid_t child = 0;
  std::ifstream(pid_file) >> child;
  ASSERT_GT(child, 0);
  // Killed, which takes a moment; whoever inherits it may not yet have waited for it.
  std::string state;
  for (int i = 0; i < 250; ++i) {
    std::string number, name;
    state = "gone";
    std::ifstream("/proc/" + std::to_string(child) + "/stat") >> number >> name >> state;
    if (state == "gone" || state == "Z" || state == "X") return;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  FAIL() << "the browser's child is in state " << state;
}

TEST_F(BrowserTest, StopsWhenAsked) {
  const auto browser =
      Browser::Start({.program = Script("exec sleep 600"), .stop = [] { return true; }});
  EXPECT_EQ(browser.status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace adhesim
