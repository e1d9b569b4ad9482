#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>

#include "core/scene/mesh/mesh_formats.h"
#include "core/scene/mesh/mesh_text.h"

namespace adhesim {
namespace {

// Statements that say nothing about the shape of a polygonal surface.
constexpr std::array<absl::string_view, 16> kIgnored = {
    "vt", "vn",     "vp",     "g",      "o",      "s",   "mg",    "l",
    "p",  "usemtl", "mtllib", "usemap", "maplib", "lod", "bevel", "c_interp"};

// The vertex of "7", "7/1", "7//3" or "-1": counted from 1, or backwards from the last one read.
bool ParseCorner(absl::string_view word, std::size_t vertices_so_far, std::int64_t* corner) {
  std::int64_t index = 0;
  if (!ParseWhole(word.substr(0, word.find('/')), &index) || index == 0) return false;
  *corner = index > 0 ? index - 1 : static_cast<std::int64_t>(vertices_so_far) + index;
  return true;
}

}  // namespace

absl::StatusOr<TriangleMesh> ParseObj(absl::string_view bytes) {
  TriangleMesh mesh;
  // Faces may come before their vertices: they are checked at the end, with the line they stood on.
  struct Face {
    int line;
    std::vector<std::int64_t> corners;
  };
  std::vector<Face> faces;
  LineReader line(bytes, '#');
  while (line.Next()) {
    const absl::string_view keyword = line.words()[0];
    if (keyword == "v") {
      mesh.vertices.emplace_back();
      if (absl::Status s = ParsePoint(line, 1, &mesh.vertices.back()); !s.ok()) return s;
    } else if (keyword == "f") {
      faces.push_back({line.number(), {}});
      for (std::size_t i = 1; i < line.words().size(); ++i) {
        std::int64_t corner = 0;
        if (!ParseCorner(line.words()[i], mesh.vertices.size(), &corner)) {
          return line.Error("a face's vertex must be a whole number other than 0");
        }
        faces.back().corners.push_back(corner);
      }
    } else if (std::find(kIgnored.begin(), kIgnored.end(), keyword) == kIgnored.end()) {
      return line.Error("not a statement of a polygonal OBJ file");
    }
    if (absl::Status s = CheckSize(mesh.vertices.size(), faces.size()); !s.ok()) {
      return line.Error(s.message());
    }
  }
  for (const Face& face : faces) {
    if (absl::Status s = AddPolygon(face.corners, mesh.vertices.size(), &mesh); !s.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("line ", face.line, ": ", s.message()));
    }
  }
  return mesh;
}

}  // namespace adhesim
