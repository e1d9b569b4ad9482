#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <string>

#include "core/model/geometry.h"

namespace adhesim {

constexpr std::size_t kMaxMeshBytes = std::size_t{256} << 20;
constexpr std::size_t kMaxMeshVertices = 2'000'000;
constexpr std::size_t kMaxMeshTriangles = 4'000'000;

// Reads the surface in an OBJ, STL, PLY, OFF or PML file (text or binary where the format knows
// both), in the file's own unit. Only positions and faces are read; polygons are cut into fans.
// `component` chooses among those of a PML file (see PmlSurface); other files have none.
// Coordinates are finite and indices in range, or there is an error that names file and line (or
// vertex). Whether the surface can be a body is CheckMesh's question.
absl::StatusOr<TriangleMesh> ReadMesh(const std::string& path, const std::string& component = "");

}  // namespace adhesim
