#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "clients/cli/load_scene.h"
#include "clients/cli/output.h"

namespace adhesim {

// What a scene switches on and which line of it asks for that, what each stage costs in time
// (measured over some steps from the scene's start) and in memory, and the stages and effects that
// it leaves out. Errors: what Engine::Create refuses.
absl::StatusOr<Json> ExplainScene(const LoadedScene& loaded);

std::string ExplanationText(const Json& explanation);

}  // namespace adhesim
