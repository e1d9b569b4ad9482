#include "core/scene/mesh/read_mesh.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "core/scene/mesh/mesh_formats.h"
#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/read_file.h"

namespace adhesim {

absl::StatusOr<TriangleMesh> ReadMesh(const std::string& path) {
  using Parser = absl::StatusOr<TriangleMesh> (*)(absl::string_view);
  const std::string extension = Extension(path);
  const Parser parse = extension == "obj"   ? &ParseObj
                       : extension == "off" ? &ParseOff
                       : extension == "ply" ? &ParsePly
                       : extension == "stl" ? &ParseStl
                                            : nullptr;
  if (parse == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': surfaces are read from .obj, .off, .ply and .stl files"));
  }
  const absl::StatusOr<std::string> bytes = ReadFile(path, kMaxMeshBytes);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<TriangleMesh> mesh = parse(*bytes);
  const auto error = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", what));
  };
  if (!mesh.ok()) return error(mesh.status().message());
  if (mesh->triangles.empty()) return error("no triangles in this file");
  if (absl::Status s = CheckSize(mesh->vertices.size(), mesh->triangles.size()); !s.ok()) {
    return error(s.message());
  }
  return mesh;
}

}  // namespace adhesim
