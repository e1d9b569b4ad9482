#include "core/scene/body_mesh.h"

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

#include <cmath>
#include <utility>

#include "core/scene/body_file.h"
#include "core/scene/field_value.h"
#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/embed.h"
#include "core/scene/mesh/generate.h"
#include "core/scene/mesh/lattice.h"
#include "core/scene/mesh/read_mesh.h"
#include "core/scene/mesh/read_surface.h"
#include "core/scene/mesh/read_tet_mesh.h"
#include "core/scene/mesh/simplify.h"

namespace adhesim {
namespace {

int CountOf(const google::protobuf::Message& message, const char* field) {
  return static_cast<int>(NumberOf(message, field));
}

// `label_at` is set where the surface has labels inside.
absl::StatusOr<TriangleMesh> MakeSurface(const v1::Body& body, const std::string& directory,
                                         LabelAt* label_at) {
  switch (body.shape_case()) {
    case v1::Body::kIcosphere:
      return MakeIcosphere(body.icosphere().radius_m(), CountOf(body.icosphere(), "subdivisions"));
    case v1::Body::kSheet:
      return MakeSheet(body.sheet().length_m(), body.sheet().width_m(),
                       CountOf(body.sheet(), "columns"), CountOf(body.sheet(), "rows"));
    case v1::Body::kBlock:
      return MakeBlock(Vec3Of(body.block(), "size_m"), CountOf(body.block(), "cells"));
    case v1::Body::kOrgan:
      return MakeOrgan(NumberOf(body.organ(), "length_m"), CountOf(body.organ(), "particles"));
    case v1::Body::kMesh: {
      const absl::StatusOr<std::string> file = ResolveFile(body.mesh().file(), directory);
      if (!file.ok()) return file.status();
      absl::StatusOr<TriangleMesh> mesh = ReadMesh(*file, body.mesh().component());
      if (!mesh.ok()) return mesh;
      for (Vec3& v : mesh->vertices) v *= NumberOf(body.mesh(), "scale_m");
      if (!body.mesh().has_particles()) return mesh;
      return Decimated(*mesh, CountOf(body.mesh(), "particles"));
    }
    case v1::Body::kLabelMap: {
      const absl::StatusOr<std::string> file = ResolveFile(body.label_map().file(), directory);
      if (!file.ok()) return file.status();
      absl::StatusOr<LabelledSurface> labelled =
          ReadLabelSurface(*file, CountOf(body.label_map(), "particles"));
      if (!labelled.ok()) return labelled.status();
      *label_at = std::move(labelled->label_at);
      if (labelled->too_many_labels && body.has_tetrahedra()) {
        return absl::InvalidArgumentError(
            "more than 254 different labels; at most 254 are permitted with tetrahedra");
      }
      return std::move(labelled->surface);
    }
    case v1::Body::kTetMesh:
    case v1::Body::SHAPE_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("the body has no shape");
}

// For messages about what a file holds, from code that does not know the file.
std::string FilePrefix(const v1::Body& body) {
  return FileOf(body) == nullptr ? "" : absl::StrCat("'", *FileOf(body), "': ");
}

absl::StatusOr<TetMesh> ReadBodyTetMesh(const v1::Body& body, const std::string& directory) {
  const absl::StatusOr<std::string> file = ResolveFile(body.tet_mesh().file(), directory);
  if (!file.ok()) return file.status();
  absl::StatusOr<TetMesh> mesh = ReadTetMesh(*file);
  if (!mesh.ok()) return mesh;
  const double scale_m = NumberOf(body.tet_mesh(), "scale_m");
  for (Vec3& v : mesh->surface.vertices) v *= scale_m;
  for (const Tetrahedron& t : mesh->tetrahedra) {
    const double volume_m3 = TetVolume(mesh->surface.vertices, t);
    if (volume_m3 > 0 && std::isfinite(volume_m3)) continue;
    return absl::InvalidArgumentError(absl::StrCat("'", *file, "': with scale_m ", scale_m,
                                                   " a tetrahedron has a volume of ", volume_m3,
                                                   " m^3"));
  }
  return mesh;
}

// A body that is its surface only: the surface must be fit for that.
std::optional<TetMesh> SurfaceOnly(const v1::Body& body, const std::string& path,
                                   TriangleMesh surface, Problems* problems) {
  bool fit = true;
  for (const MeshFlaw& flaw : CheckMesh(surface).flaws) {
    problems->push_back({ShapePath(body, path), FilePrefix(body) + flaw.message, flaw.warning});
    fit = fit && flaw.warning;
  }
  if (!fit) return std::nullopt;
  TetMesh mesh;
  mesh.surface = std::move(surface);
  return mesh;
}

}  // namespace

std::optional<TetMesh> MakeBodyMesh(const v1::Body& body, const std::string& path,
                                    const std::string& directory, Problems* problems) {
  const auto take = [&](absl::StatusOr<TetMesh> mesh,
                        const std::string& field) -> std::optional<TetMesh> {
    if (!mesh.ok()) {
      problems->push_back({field, std::string(mesh.status().message())});
      return std::nullopt;
    }
    for (const std::string& warning : mesh->warnings) {
      problems->push_back({ShapePath(body, path), FilePrefix(body) + warning, /*warning=*/true});
    }
    return *std::move(mesh);
  };
  const std::string tetrahedra_path = path + ".tetrahedra";
  const int cells = CountOf(body.tetrahedra(), "cells");
  if (body.has_block() && body.has_tetrahedra()) {
    return take(MakeTetBlock(Vec3Of(body.block(), "size_m"), cells), tetrahedra_path);
  }
  if (body.has_tet_mesh()) return take(ReadBodyTetMesh(body, directory), ShapePath(body, path));
  LabelAt label_at;
  absl::StatusOr<TriangleMesh> surface = MakeSurface(body, directory, &label_at);
  if (!surface.ok()) return take(surface.status(), ShapePath(body, path));
  if (!body.has_tetrahedra()) return SurfaceOnly(body, path, *std::move(surface), problems);
  absl::StatusOr<TetMesh> mesh = EmbedInLattice(*surface, cells, label_at);
  if (mesh.ok()) return take(std::move(mesh), tetrahedra_path);
  return take(
      absl::Status(mesh.status().code(), absl::StrCat(FilePrefix(body), mesh.status().message())),
      tetrahedra_path);
}

}  // namespace adhesim
