#include "core/scene/mesh/read_surface.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <vector>

#include "core/scene/mesh/label_map.h"
#include "core/scene/mesh/read_mesh.h"
#include "core/scene/mesh/surface_from_labels.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> AssetFolders(const std::string& directory) {
  std::vector<fs::path> folders;
  if (const char* named = std::getenv("ADHESIM_ASSETS"); named != nullptr && *named != '\0') {
    folders.emplace_back(named);
  }
  folders.push_back(fs::path("build") / "assets");
  std::error_code error;
  fs::path ancestor = fs::weakly_canonical(directory, error);
  while (!error && !ancestor.empty()) {
    folders.push_back(ancestor / "build" / "assets");
    if (ancestor == ancestor.parent_path()) break;
    ancestor = ancestor.parent_path();
  }
  folders.emplace_back("/usr/share/adhesim/assets");
  return folders;
}

}  // namespace

absl::StatusOr<std::string> ResolveFile(const std::string& file, const std::string& directory) {
  absl::string_view name = file;
  if (!absl::ConsumePrefix(&name, "asset:")) {
    return (fs::path(directory) / file).lexically_normal().string();
  }
  const fs::path asset{std::string(name)};
  if (asset.empty() || asset != asset.filename() || asset == "." || asset == "..") {
    return absl::InvalidArgumentError(
        absl::StrCat("'", file, "': after 'asset:' comes the name of a file, without a folder"));
  }
  for (const fs::path& folder : AssetFolders(directory)) {
    std::error_code ignored;
    if (fs::is_regular_file(folder / asset, ignored)) return (folder / asset).string();
  }
  return absl::NotFoundError(absl::StrCat(
      "'", file,
      "' is not installed: run scenes/fetch_assets.sh, which puts it into build/assets, ",
      "or set ADHESIM_ASSETS to the folder that holds it"));
}

absl::StatusOr<TriangleMesh> ReadLabelSurface(const std::string& path, int particles) {
  const absl::StatusOr<SolidMap> map = ReadLabelMap(path);
  if (!map.ok()) return map.status();
  absl::StatusOr<TriangleMesh> mesh = SurfaceFromLabels(*map, particles);
  if (mesh.ok()) return mesh;
  return absl::Status(mesh.status().code(),
                      absl::StrCat("'", path, "': ", mesh.status().message()));
}

absl::StatusOr<TriangleMesh> ReadAnySurface(const std::string& path, int particles,
                                            const std::string& component) {
  return IsLabelMapName(path) && component.empty() ? ReadLabelSurface(path, particles)
                                                   : ReadMesh(path, component);
}

}  // namespace adhesim
