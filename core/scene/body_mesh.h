#pragma once

#include <optional>
#include <string>

#include "adhesim/v1/scene.pb.h"
#include "core/scene/mesh/tet_mesh.h"
#include "core/scene/problem.h"

namespace adhesim {

// Reads or generates what a body is made of, in its shape's own coordinates [m], and examines it.
// Nothing when a problem is more than a warning. Files are relative to `directory`; `path` is the
// body's own ("bodies[1]").
std::optional<TetMesh> MakeBodyMesh(const v1::Body& body, const std::string& path,
                                    const std::string& directory, Problems* problems);

}  // namespace adhesim
