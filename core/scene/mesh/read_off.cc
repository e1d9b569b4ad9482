#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "core/scene/mesh/mesh_formats.h"
#include "core/scene/mesh/mesh_text.h"

namespace adhesim {

absl::StatusOr<TriangleMesh> ParseOff(absl::string_view bytes) {
  LineReader line(bytes, '#');
  // OFF, COFF (colours), NOFF (normals), STOFF...: the three coordinates come first in each.
  if (!line.Next() || !absl::EndsWith(line.words()[0], "OFF") || line.words()[0] == "4OFF" ||
      line.words()[0] == "nOFF") {
    return absl::InvalidArgumentError("an OFF file begins with the word OFF");
  }
  std::size_t first = 1;  // the counts may stand on the same line
  if (line.words().size() == 1) {
    if (!line.Next()) return line.Error("the numbers of vertices and faces are missing");
    first = 0;
  }
  std::int64_t vertex_count = 0, face_count = 0;
  if (line.words().size() < first + 2 || !ParseWhole(line.words()[first], &vertex_count) ||
      !ParseWhole(line.words()[first + 1], &face_count) || vertex_count < 0 || face_count < 0) {
    return line.Error("expected the numbers of vertices and faces (text, not OFF BINARY)");
  }
  // A line has at least two bytes: more lines than that cannot come.
  const auto bytes_count = static_cast<std::int64_t>(bytes.size());
  if (vertex_count > bytes_count / 2 || face_count > bytes_count / 2) {
    return line.Error(absl::StrCat(vertex_count, " vertices and ", face_count,
                                   " faces do not fit into a file of ", bytes_count, " bytes"));
  }
  if (absl::Status s =
          CheckSize(static_cast<std::size_t>(vertex_count), static_cast<std::size_t>(face_count));
      !s.ok()) {
    return line.Error(s.message());
  }

  TriangleMesh mesh;
  mesh.vertices.reserve(static_cast<std::size_t>(vertex_count));
  for (std::int64_t i = 0; i < vertex_count; ++i) {
    if (!line.Next()) {
      return line.Error(absl::StrCat("the file ends after ", i, " of ", vertex_count, " vertices"));
    }
    mesh.vertices.emplace_back();
    if (absl::Status s = ParsePoint(line, 0, &mesh.vertices.back()); !s.ok()) return s;
  }
  std::vector<std::int64_t> corners;
  for (std::int64_t i = 0; i < face_count; ++i) {
    if (!line.Next()) {
      return line.Error(absl::StrCat("the file ends after ", i, " of ", face_count, " faces"));
    }
    // "3 0 1 2", and perhaps a colour.
    std::int64_t corner_count = 0;
    if (!ParseWhole(line.words()[0], &corner_count) || corner_count < 0 ||
        corner_count >= static_cast<std::int64_t>(line.words().size())) {
      return line.Error("a face is the number of its vertices and as many vertices");
    }
    corners.resize(static_cast<std::size_t>(corner_count));
    for (std::size_t k = 0; k < corners.size(); ++k) {
      if (!ParseWhole(line.words()[k + 1], &corners[k])) {
        return line.Error("a face's vertex must be a whole number");
      }
    }
    if (absl::Status s = AddPolygon(corners, mesh.vertices.size(), &mesh); !s.ok()) {
      return line.Error(s.message());
    }
  }
  return mesh;
}

}  // namespace adhesim
