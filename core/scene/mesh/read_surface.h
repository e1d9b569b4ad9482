#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "core/model/geometry.h"
#include "core/scene/mesh/fill_cells.h"

namespace adhesim {

// The path of a file as a scene writes it: relative to the scene's directory; "asset:NAME" is a
// file that set-up installed (scenes/fetch_assets.sh), looked for in $ADHESIM_ASSETS, then in
// build/assets below the current directory and below the scene's directory and its ancestors, then
// in /usr/share/adhesim/assets.
absl::StatusOr<std::string> ResolveFile(const std::string& file, const std::string& directory);

// The surface around the labels of an image file, in metres, and which label is where: at the voxel
// that holds a point of the surface's coordinates; -1 outside of all.
struct LabelledSurface {
  TriangleMesh surface;
  LabelAt label_at;
  bool too_many_labels = false;  // see SolidMap
};
absl::StatusOr<LabelledSurface> ReadLabelSurface(const std::string& path, int particles);

// Whatever surface a file holds: a mesh in its own unit (`component`: see ReadMesh), or a label map
// with `particles` vertices in metres.
absl::StatusOr<TriangleMesh> ReadAnySurface(const std::string& path, int particles = 1500,
                                            const std::string& component = "");

}  // namespace adhesim
