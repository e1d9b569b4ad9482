#pragma once

#include <string>

namespace adhesim {

// The JSON Schema (draft 2020-12) of a scene, for editors: every field with its description, type,
// range, default and units, made from the message's descriptors. It permits what ParseScene
// permits, but for the rules between fields.
std::string SceneJsonSchema();

}  // namespace adhesim
