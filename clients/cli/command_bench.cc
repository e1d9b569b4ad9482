#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "clients/cli/commands.h"

namespace adhesim {
namespace {

constexpr const char* kProgram = "adhesim_bench";

// Becomes the program beside this one, which links Bullet's soft bodies: its exit code and the
// signals that end it are what the caller sees. Returns when that cannot be.
int RunBench(const std::vector<std::string>& arguments) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  std::string program = self.parent_path() / kProgram;
  std::vector<std::string> words = arguments;
  std::vector<char*> argv = {program.data()};
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::cout.flush();
  if (!error) execv(program.c_str(), argv.data());
  std::cerr << "error: cannot run " << program << ": "
            << (error ? error.message() : std::strerror(errno))
            << "; it is built beside this program: ./dev bench does that\n";
  return kExitBadInput;
}

}  // namespace

void AddBenchCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "bench",
      "Step times of the scenes, and of Bullet's soft bodies on the same meshes in the same run:\n"
      "adhesim bench [NAME...] [--scenes DIR] [--seconds S] [--repeats N] [--simd NAME] "
      "[--json FILE]");
  // What it takes, its help too, is said in one place: the other program.
  command->set_help_flag();
  command->prefix_command();
  command->callback([=] { *exit_code = RunBench(command->remaining()); });
}

}  // namespace adhesim
