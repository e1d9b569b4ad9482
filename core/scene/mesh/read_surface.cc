#include "core/scene/mesh/read_surface.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>
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

absl::StatusOr<LabelledSurface> ReadLabelSurface(const std::string& path, int particles) {
  absl::StatusOr<SolidMap> map = ReadLabelMap(path);
  if (!map.ok()) return map.status();
  PlaceInImage place;
  absl::StatusOr<TriangleMesh> surface = SurfaceFromLabels(*map, particles, &place);
  if (!surface.ok()) {
    return absl::Status(surface.status().code(),
                        absl::StrCat("'", path, "': ", surface.status().message()));
  }
  const bool too_many = map->too_many_labels;
  auto image = std::make_shared<const SolidMap>(*std::move(map));
  const auto label_at = [image, place](const Vec3& point) {
    const Vec3 voxel =
        (place.origin_m + point / place.scale).cwiseQuotient(image->spacing_m).array().floor();
    std::size_t index = 0;
    for (int axis = 2; axis >= 0; --axis) {
      if (!(voxel[axis] >= 0 && voxel[axis] < image->size[axis])) return -1;
      index = index * image->size[axis] + static_cast<std::size_t>(voxel[axis]);
    }
    const std::uint8_t number = image->solid[index];
    if (number == 0 || number > image->labels.size()) return -1;
    const std::uint32_t label = image->labels[number - 1];
    return label <= INT32_MAX ? static_cast<std::int32_t>(label) : -1;
  };
  return LabelledSurface{*std::move(surface), label_at, too_many};
}

absl::StatusOr<TriangleMesh> ReadAnySurface(const std::string& path, int particles,
                                            const std::string& component) {
  if (!IsLabelMapName(path) || !component.empty()) return ReadMesh(path, component);
  absl::StatusOr<LabelledSurface> labelled = ReadLabelSurface(path, particles);
  if (!labelled.ok()) return labelled.status();
  return std::move(labelled->surface);
}

}  // namespace adhesim
