#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/explain.h"
#include "clients/cli/load_scene.h"
#include "clients/cli/output.h"
#include "core/scene/scene_text.h"
#include "core/scene/schema.h"
#include "core/scene/validate.h"

namespace adhesim {
namespace {

int Check(const std::vector<std::string>& files) {
  int exit_code = kExitOk;
  for (const std::string& file : files) {
    const std::optional<LoadedScene> loaded = LoadScene(file);
    if (loaded) {
      std::cout << file << ": ok, " << loaded->model->bodies.size() << " bodies, "
                << loaded->model->particle_count() << " particles" << std::endl;
    } else {
      exit_code = kExitBadInput;
    }
  }
  return exit_code;
}

// Needs no meshes: a scene can be shown before they are there.
int Show(const std::string& path) {
  const SceneFile file = ReadSceneFile(path);
  std::cerr << file.Format(file.problems, ColourOnStderr());
  if (!file.ok()) return kExitBadInput;
  std::cout << SceneToYaml(WithDefaults(file.scene));
  return kExitOk;
}

int Schema() {
  std::cout << SceneJsonSchema() << "\n";
  return kExitOk;
}

int Explain(const std::string& path, bool json) {
  const std::optional<LoadedScene> loaded = LoadScene(path);
  if (!loaded) return kExitBadInput;
  const absl::StatusOr<Json> explanation = ExplainScene(*loaded);
  if (!explanation.ok()) {
    std::cerr << path << ": error: " << explanation.status().message() << "\n";
    return kExitBadInput;
  }
  if (json) {
    PrintJson(*explanation);
  } else {
    std::cout << ExplanationText(*explanation);
  }
  return kExitOk;
}

struct Arguments {
  std::vector<std::string> files;
  std::string file;
  bool json = false;
};

}  // namespace

void AddSceneCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "scene", "Checks, explains and shows scene files; prints their JSON Schema");
  command->require_subcommand(1);
  auto arguments = std::make_shared<Arguments>();

  CLI::App* check =
      command->add_subcommand("check", "Reports every mistake in scenes, meshes included");
  check->add_option("FILE", arguments->files, "Scene files")->required();
  check->callback([=] { *exit_code = Check(arguments->files); });

  CLI::App* show = command->add_subcommand("show", "Prints a scene with every default written out");
  show->add_option("FILE", arguments->file, "Scene file")->required();
  show->callback([=] { *exit_code = Show(arguments->file); });

  CLI::App* schema =
      command->add_subcommand("schema", "Prints the JSON Schema of scenes, for editors");
  schema->callback([=] { *exit_code = Schema(); });

  CLI::App* explain = command->add_subcommand(
      "explain", "Prints what a scene switches on, what each stage costs, what is left out");
  explain->add_option("FILE", arguments->file, "Scene file")->required();
  explain->add_flag("--json", arguments->json, "Prints one JSON object");
  explain->callback([=] { *exit_code = Explain(arguments->file, arguments->json); });
}

}  // namespace adhesim
