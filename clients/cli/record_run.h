#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "clients/cli/load_scene.h"
#include "core/engine/engine.h"
#include "server/recording/recorder.h"

namespace adhesim {

// Compiler, kind of build and instructions, as recordings name them.
std::string BuildText();

// Begins the recording of a headless run. `frames_hz`: frames per simulated second.
absl::StatusOr<std::unique_ptr<Recorder>> RecordRun(const std::string& path, double frames_hz,
                                                    const LoadedScene& scene, const Engine& engine);

}  // namespace adhesim
