#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "core/model/geometry.h"

namespace adhesim {

// One strict reader per format, on the bytes of a file that others wrote.
//
// Why not a library: assimp 5.2 (Debian's) repairs silently (it drops faces, joins vertices,
// invents normals), tells neither line nor reason, and its readers have been the subject of
// memory-safety advisories up to that version. The four formats take some sixty lines each; what
// they do not understand they refuse, naming the line.
//
// Every reader checks counts against the number of bytes before it reserves memory, and every index
// and coordinate.
absl::StatusOr<TriangleMesh> ParseObj(absl::string_view bytes);
absl::StatusOr<TriangleMesh> ParseOff(absl::string_view bytes);
absl::StatusOr<TriangleMesh> ParsePly(absl::string_view bytes);
absl::StatusOr<TriangleMesh> ParseStl(
    absl::string_view bytes);  // merges vertices at the same place

}  // namespace adhesim
