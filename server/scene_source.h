#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "adhesim/v1/scene.pb.h"
#include "core/engine/engine.h"
#include "core/scene/problem.h"

namespace adhesim {

// A scene on offer.
struct OfferedScene {
  std::string name;
  std::string description;
};

// A scene as it was read, and where its files are.
struct ReadScene {
  v1::Scene scene;
  std::string directory;
};

// Where scenes come from and what sets them in motion: handed to the server by the program, so that
// the server knows neither files nor physics. Called from several threads at once.
struct SceneSource {
  std::function<std::vector<OfferedScene>()> list;
  // Errors: NotFound, or InvalidArgument with every mistake of the file.
  std::function<absl::StatusOr<ReadScene>(const std::string& name)> read;
  // Validates, builds and compiles. Null exactly when a problem is more than a warning.
  std::function<std::unique_ptr<Engine>(const ReadScene& scene, Problems* problems)> build;
  // Where the files of a scene that a client sends are looked for.
  std::string inline_directory;
};

}  // namespace adhesim
