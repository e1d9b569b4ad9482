#include "core/scene/mesh/read_mesh.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "core/scene/mesh/mesh_formats.h"
#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/pml_surface.h"
#include "core/scene/mesh/read_file.h"
#include "core/scene/mesh/read_pml.h"

namespace adhesim {

namespace {

absl::StatusOr<TriangleMesh> ReadPmlSurface(absl::string_view bytes, const std::string& component) {
  const absl::StatusOr<PmlModel> model = ParsePml(bytes);
  if (!model.ok()) return model.status();
  return PmlSurface(*model, component);
}

}  // namespace

absl::StatusOr<TriangleMesh> ReadMesh(const std::string& path, const std::string& component) {
  using Parser = absl::StatusOr<TriangleMesh> (*)(absl::string_view);
  const std::string extension = Extension(path);
  const Parser parse = extension == "obj"   ? &ParseObj
                       : extension == "off" ? &ParseOff
                       : extension == "ply" ? &ParsePly
                       : extension == "stl" ? &ParseStl
                                            : nullptr;
  const bool is_pml = extension == "pml";
  if (parse == nullptr && !is_pml) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': surfaces are read from .obj, .off, .ply, .pml and .stl files"));
  }
  if (!is_pml && !component.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': only .pml files have components to choose from"));
  }
  const absl::StatusOr<std::string> bytes = ReadFile(path, kMaxMeshBytes);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<TriangleMesh> mesh = is_pml ? ReadPmlSurface(*bytes, component) : parse(*bytes);
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
