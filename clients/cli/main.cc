// The program `adhesim`: every command, the service and the clients in one binary.

#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "core/scene/did_you_mean.h"

namespace adhesim {
namespace {

// " (did you mean 'run'?)" when the first word that is no command of its level resembles one;
// otherwise empty.
std::string SuggestCommand(const CLI::App& app, int argc, char** argv) {
  const CLI::App* level = &app;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    std::vector<std::string> names;
    const CLI::App* next = nullptr;
    for (const CLI::App* command : level->get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(command->get_name());
      if (command->get_name() == word) next = command;
    }
    if (next == nullptr) return word.empty() || word[0] == '-' ? "" : DidYouMean(word, names);
    level = next;
  }
  return "";
}

int Main(int argc, char** argv) {
  CLI::App app("adhesim: a real-time back-end for surgical simulation with sticky tissue",
               "adhesim");
  app.set_version_flag("--version", "adhesim " ADHESIM_VERSION);
  app.require_subcommand(1);
  int exit_code = kExitOk;
  AddRunCommand(app, &exit_code);
  AddRenderCommand(app, &exit_code);
  AddPaperCommand(app, &exit_code);
  AddStressCommand(app, &exit_code);
  AddBenchCommand(app, &exit_code);
  AddReplayCommand(app, &exit_code);
  AddSceneCommand(app, &exit_code);
  AddMeshCommand(app, &exit_code);
  AddServeCommand(app, &exit_code);
  AddOperateCommand(app, &exit_code);
  AddWatchCommand(app, &exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // --help and --version end here too, with 0.
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << "error: " << error.what() << SuggestCommand(app, argc, argv)
              << "\nSee adhesim --help.\n";
    return kExitBadInput;
  }
  return exit_code;
}

}  // namespace
}  // namespace adhesim

int main(int argc, char** argv) {
  try {
    return adhesim::Main(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << "\n";
    return adhesim::kExitCheckFailed;
  }
}
