// The program `adhesim`: every command, the service and the clients in one binary.

#include <algorithm>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "core/scene/did_you_mean.h"

namespace adhesim {
namespace {

struct Hint {
  std::string suggestion;  // " (did you mean 'run'?)", or empty
  std::string help;        // the command whose --help says more: "adhesim scene"
};

// What was meant by the first word that is neither a command of its level nor one of its options.
Hint HintFor(const CLI::App& app, int argc, char** argv) {
  Hint hint{"", app.get_name()};
  const CLI::App* level = &app;
  for (int i = 1; i < argc && hint.suggestion.empty(); ++i) {
    const std::string word = argv[i];
    std::vector<std::string> names;
    if (word.rfind("--", 0) == 0) {
      for (const CLI::Option* option : level->get_options()) {
        for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
      }
      const std::string name = word.substr(0, word.find('='));
      if (std::find(names.begin(), names.end(), name) == names.end())
        hint.suggestion = DidYouMean(name, names);
      continue;
    }
    const CLI::App* next = nullptr;
    for (const CLI::App* command : level->get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(command->get_name());
      if (command->get_name() == word) next = command;
    }
    if (next != nullptr) {
      level = next;
      hint.help += " " + word;
    } else if (!word.empty() && word[0] != '-') {
      hint.suggestion = DidYouMean(word, names);
    }
  }
  return hint;
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
  AddAccuracyCommand(app, &exit_code);
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
    const Hint hint = HintFor(app, argc, argv);
    std::cerr << "error: " << error.what() << hint.suggestion << "\nSee " << hint.help
              << " --help.\n";
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
