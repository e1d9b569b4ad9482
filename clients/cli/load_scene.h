#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/model/model.h"
#include "core/scene/scene_file.h"

namespace adhesim {

struct LoadedScene {
  SceneFile file;  // its scene as written, with the settings applied
  std::shared_ptr<const Model> model;
};

// Reads a scene file, applies settings ("rate_hz=500") in their order and makes the model. Prints
// every problem to stderr; empty when one of them is more than a warning.
std::optional<LoadedScene> LoadScene(const std::string& path,
                                     const std::vector<std::string>& settings = {});

// Prints why an engine refused the scene, with the line of the field that the message begins with.
void PrintRefusal(const SceneFile& file, const absl::Status& status);

// Adds the option --set, whose values go to LoadScene.
void AddSettingsOption(CLI::App* command, std::vector<std::string>* settings);

}  // namespace adhesim
