#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace adhesim::test {

// A command of the program as users run it, in a directory of its own.
class CommandTest : public ::testing::Test {
 protected:
  explicit CommandTest(const std::string& command)
      : command_(command),
        // Tests may run at the same time in processes of their own.
        directory_(::testing::TempDir() + command + "_test_" + std::to_string(getpid())) {}
  void SetUp() override { std::filesystem::create_directories(directory_); }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  // The exit code; what it printed is in the files "out" and "err".
  int Run(const std::string& arguments) const {
    const std::string line = std::string(ADHESIM_PROGRAM) + " " + command_ + " " + arguments +
                             " >" + File("out") + " 2>" + File("err") + " </dev/null";
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string File(const std::string& name) const { return directory_ + "/" + name; }
  std::string Read(const std::string& name) const {
    std::ifstream stream(File(name));
    return std::string((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  }

  const std::string command_, directory_;
};

}  // namespace adhesim::test
