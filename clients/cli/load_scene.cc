#include "clients/cli/load_scene.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <filesystem>
#include <iostream>
#include <utility>

#include "clients/cli/output.h"
#include "core/scene/body_file.h"
#include "core/scene/build_model.h"
#include "core/scene/field_options.h"
#include "core/scene/scene_text.h"
#include "core/scene/validate.h"

namespace adhesim {
namespace {

void Print(const SceneFile& file, const Problems& problems) {
  std::cerr << file.Format(problems, ColourOnStderr());
}

// Meshes that are not there. Building the model finds them too, but a scene with other mistakes is
// not built, and all mistakes are to be reported at once.
Problems MissingFiles(const SceneFile& file) {
  Problems problems;
  const auto check = [&](const std::string& name, const std::string& path) {
    if (name.empty() || absl::StartsWith(name, "asset:")) return;
    std::error_code error;
    if (std::filesystem::exists(std::filesystem::path(file.directory) / name, error)) return;
    problems.push_back({path, absl::StrCat("no such file: '", name, "'")});
  };
  for (int i = 0; i < file.scene.bodies_size(); ++i) {
    const v1::Body& body = file.scene.bodies(i);
    if (const std::string* name = FileOf(body))
      check(*name, ShapePath(body, IndexPath("bodies", i)));
  }
  return problems;
}

// False, after a message, when a setting is wrong.
bool ApplySettings(const std::vector<std::string>& settings, v1::Scene* scene) {
  bool ok = true;
  // They were measured on the scene as its file has it.
  if (!settings.empty()) scene->clear_rungs();
  for (const std::string& setting : settings) {
    const std::size_t equals = setting.find('=');
    absl::Status status = absl::InvalidArgumentError("expected PATH=VALUE, as in rate_hz=500");
    if (equals != std::string::npos) {
      status = SetField(scene, setting.substr(0, equals), setting.substr(equals + 1));
    }
    if (!status.ok()) std::cerr << "error: --set " << setting << ": " << status.message() << "\n";
    ok = ok && status.ok();
  }
  return ok;
}

}  // namespace

std::optional<LoadedScene> LoadScene(const std::string& path,
                                     const std::vector<std::string>& settings) {
  LoadedScene loaded;
  loaded.file = ReadSceneFile(path);
  Problems problems = loaded.file.problems;
  if (!loaded.file.ok()) {
    for (Problem& problem : MissingFiles(loaded.file)) problems.push_back(std::move(problem));
  }
  Print(loaded.file, problems);
  if (!loaded.file.ok() || !ApplySettings(settings, &loaded.file.scene)) return std::nullopt;
  if (!settings.empty()) {
    const Problems contradictions = ValidateScene(loaded.file.scene);
    Print(loaded.file, contradictions);
    if (!AllWarnings(contradictions)) return std::nullopt;
  }

  BuiltModel built = BuildModel(WithDefaults(loaded.file.scene), loaded.file.directory);
  Print(loaded.file, built.problems);
  if (built.model == nullptr || !AllWarnings(built.problems)) return std::nullopt;
  loaded.model = std::move(built.model);
  return loaded;
}

void PrintRefusal(const SceneFile& file, const absl::Status& status) {
  const std::string message(status.message());
  const std::size_t colon = message.find(": ");
  const bool names = colon != std::string::npos && file.tree.root >= 0 &&
                     file.tree.Locate(message.substr(0, colon)) != &file.tree.nodes[file.tree.root];
  if (names) return Print(file, {{message.substr(0, colon), message.substr(colon + 2)}});
  std::cerr << file.file << ": error: " << message << "\n";
}

void AddSettingsOption(CLI::App* command, std::vector<std::string>* settings) {
  command
      ->add_option("--set", *settings,
                   "Sets a field of the scene: PATH=VALUE, as in effects[0].drag.rate_per_s=0.5")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
}

}  // namespace adhesim
