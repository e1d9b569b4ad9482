#include <iostream>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/explain.h"
#include "clients/cli/load_scene.h"
#include "clients/cli/output.h"
#include "clients/cli/write_pml_file.h"
#include "core/engine/engine.h"
#include "core/scene/mesh/pml_surface.h"
#include "core/scene/mesh/write_pml.h"
#include "core/scene/scene_text.h"
#include "core/scene/schema.h"
#include "core/scene/validate.h"

namespace adhesim {
namespace {

int Check(const std::vector<std::string>& files) {
  int exit_code = kExitOk;
  for (const std::string& file : files) {
    const std::optional<LoadedScene> loaded = LoadScene(file);
    if (!loaded) {
      exit_code = kExitBadInput;
      continue;
    }
    // What only compiling finds: effects that do not go together, too many sub-steps.
    if (const auto engine = Engine::Create(loaded->model, {}); !engine.ok()) {
      PrintRefusal(loaded->file, engine.status());
      exit_code = kExitBadInput;
      continue;
    }
    std::cout << file << ": ok, " << Counted(loaded->model->bodies.size(), "body", "bodies") << ", "
              << loaded->model->particle_count() << " particles" << std::endl;
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
    PrintRefusal(loaded->file, explanation.status());
    return kExitBadInput;
  }
  if (json) {
    PrintJson(*explanation);
  } else {
    std::cout << ExplanationText(*explanation);
  }
  return kExitOk;
}

// A model as PML: its particles with their masses, a component per body, and the neighbourhoods.
// The bodies are where the scene places them, in metres.
int Export(const std::string& path, const std::vector<std::string>& settings,
           const std::string& pml) {
  const std::optional<LoadedScene> loaded = LoadScene(path, settings);
  if (!loaded) return kExitBadInput;
  const Model& model = *loaded->model;
  std::vector<PmlPart> parts;
  for (const Body& body : model.bodies) {
    parts.push_back(
        {body.name, std::span(model.triangles).subspan(body.first_triangle, body.triangle_count)});
  }
  PmlModel exported = PmlOfSurface(model.name, model.rest_position_m, parts);
  for (std::size_t i = 0; i < exported.atoms.size(); ++i) {
    exported.atoms[i].properties = {{"mass", ShortestNumber(model.mass_kg[i])}};
  }
  return WritePmlFile(exported, pml);
}

struct Arguments {
  std::vector<std::string> files;
  std::vector<std::string> settings;
  std::string file;
  std::string pml;
  bool json = false;
};

}  // namespace

void AddSceneCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "scene", "Checks, explains, shows and exports scene files; prints their JSON Schema");
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

  CLI::App* export_command = command->add_subcommand(
      "export", "Writes the bodies of a scene as PML: particles, surfaces, neighbourhoods");
  export_command->add_option("FILE", arguments->file, "Scene file")->required();
  export_command->add_option("--pml", arguments->pml, "The file to write")->required();
  AddSettingsOption(export_command, &arguments->settings);
  export_command->callback(
      [=] { *exit_code = Export(arguments->file, arguments->settings, arguments->pml); });
}

}  // namespace adhesim
