#pragma once

#include <absl/status/status.h>

#include <string>

#include "adhesim/v1/scene.pb.h"

namespace adhesim {

// The scene as a file that ParseScene reads back to an equal message.
std::string SceneToYaml(const v1::Scene& scene);

// Sets the field at a path like "effects[0].drag.rate_per_s" to a value written as in a scene file
// ("0.5", "18 mm",
// "[0, 0, 1]"). Elements of lists are those that the scene has. Errors (InvalidArgument) say what
// is wrong with path or value and leave the scene as it was; other fields that the value
// contradicts are left to ValidateScene.
absl::Status SetField(v1::Scene* scene, const std::string& path, const std::string& value);

}  // namespace adhesim
