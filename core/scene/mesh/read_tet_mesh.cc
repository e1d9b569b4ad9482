#include "core/scene/mesh/read_tet_mesh.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <map>
#include <utility>

#include "core/scene/mesh/read_file.h"
#include "core/scene/mesh/read_mesh.h"
#include "core/scene/mesh/read_pml.h"

namespace adhesim {
namespace {

// A tetrahedron has no usable volume below this part of the cube of its longest edge: four decades
// above rounding, and far below any sliver that a mesher leaves.
constexpr double kNoVolume = 1e-12;

absl::Status Bad(const TetFile::Element& element, absl::string_view what) {
  const std::string line = element.line > 0 ? absl::StrCat("line ", element.line, ": ") : "";
  return absl::InvalidArgumentError(absl::StrCat(line, "element ", element.number, ": ", what));
}

absl::Status CheckNodes(const TetFile::Element& element, int corners, std::size_t node_count) {
  for (int k = 0; k < corners; ++k) {
    if (element.nodes[k] >= 0 && element.nodes[k] < static_cast<std::int64_t>(node_count)) continue;
    return Bad(element,
               absl::StrCat("names node ", element.nodes[k], " (counted from 0); permitted: 0 to ",
                            static_cast<std::int64_t>(node_count) - 1));
  }
  return absl::OkStatus();
}

// The corners, the right way round.
absl::StatusOr<Tetrahedron> Oriented(const TetFile::Element& element,
                                     const std::vector<Vec3>& nodes) {
  if (absl::Status s = CheckNodes(element, 4, nodes.size()); !s.ok()) return s;
  Tetrahedron t;
  for (int k = 0; k < 4; ++k) t[k] = static_cast<std::int32_t>(element.nodes[k]);
  double longest_sq = 0;
  for (int i = 0; i < 4; ++i) {
    for (int j = i + 1; j < 4; ++j) {
      longest_sq = std::max(longest_sq, (nodes[t[i]] - nodes[t[j]]).squaredNorm());
    }
  }
  const double volume = TetVolume(nodes, t), longest = std::sqrt(longest_sq);
  // Not "<= ...", which a NaN from an overflow would pass.
  if (!(std::abs(volume) > kNoVolume * longest_sq * longest)) {
    return Bad(element, absl::StrCat("a tetrahedron without volume (", std::abs(volume),
                                     "); permitted: above ", kNoVolume * longest_sq * longest,
                                     ", 1e-12 of its longest edge cubed"));
  }
  if (volume < 0) std::swap(t[2], t[3]);
  return t;
}

absl::Status CheckFaces(const TetFile& file, const std::vector<Tetrahedron>& tetrahedra) {
  std::vector<std::pair<Tetrahedron, std::size_t>> sorted;
  for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
    sorted.emplace_back(tetrahedra[t], t);
    std::sort(sorted.back().first.begin(), sorted.back().first.end());
  }
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i].first != sorted[i - 1].first) continue;
    return Bad(file.tetrahedra[sorted[i].second],
               absl::StrCat("has the same nodes as element ",
                            file.tetrahedra[sorted[i - 1].second].number, "; remove it"));
  }
  const std::vector<TetFace> faces = SortedFaces(tetrahedra);
  for (std::size_t f = 2; f < faces.size(); ++f) {
    if (faces[f].sorted != faces[f - 2].sorted) continue;
    return Bad(file.tetrahedra[faces[f].tetrahedron],
               absl::StrCat("shares a face with elements ",
                            file.tetrahedra[faces[f - 2].tetrahedron].number, " and ",
                            file.tetrahedra[faces[f - 1].tetrahedron].number,
                            "; at most two tetrahedra can meet at a face"));
  }
  return absl::OkStatus();
}

// Leaves out the nodes that no tetrahedron has; -1 for them in the result, else the new number.
std::vector<std::int32_t> KeepUsedNodes(TetFile* file, TetMesh* mesh) {
  std::vector<std::int32_t> number(file->nodes.size(), -1);
  for (const Tetrahedron& t : mesh->tetrahedra) {
    for (const std::int32_t node : t) number[node] = 0;
  }
  for (std::size_t n = 0; n < number.size(); ++n) {
    if (number[n] < 0) continue;
    number[n] = static_cast<std::int32_t>(mesh->surface.vertices.size());
    mesh->surface.vertices.push_back(file->nodes[n]);
  }
  for (Tetrahedron& t : mesh->tetrahedra) {
    for (std::int32_t& node : t) node = number[node];
  }
  const std::size_t unused = number.size() - mesh->surface.vertices.size();
  if (unused > 0) {
    mesh->warnings.push_back(absl::StrCat(unused, " of the file's ", number.size(),
                                          " nodes belong to no tetrahedron; they are left out"));
  }
  return number;
}

absl::Status AddNodeGroups(const TetFile& file, const std::vector<std::int32_t>& number,
                           TetMesh* mesh) {
  std::vector<std::vector<std::int32_t>> nodes(file.surface_names.size());
  for (const TetFile::Element& triangle : file.triangles) {
    if (absl::Status s = CheckNodes(triangle, 3, number.size()); !s.ok()) return s;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t node = number[triangle.nodes[k]];
      if (node >= 0) nodes[triangle.group].push_back(node);
    }
  }
  const auto add = [&](const std::string& name, std::vector<std::int32_t> group) {
    std::sort(group.begin(), group.end());
    group.erase(std::unique(group.begin(), group.end()), group.end());
    if (!group.empty()) mesh->node_groups.push_back({name, std::move(group)});
  };
  for (std::size_t g = 0; g < nodes.size(); ++g) add(file.surface_names[g], std::move(nodes[g]));
  for (const NodeGroup& group : file.node_groups) {
    std::vector<std::int32_t> kept;
    for (const std::int32_t node : group.nodes) {
      if (number[node] >= 0) kept.push_back(number[node]);
    }
    add(group.name, std::move(kept));
  }
  return absl::OkStatus();
}

absl::StatusOr<TetMesh> ReadPmlTets(absl::string_view bytes) {
  const absl::StatusOr<PmlModel> model = ParsePml(bytes);
  if (!model.ok()) return model.status();
  return TetMeshOfPml(*model);
}

}  // namespace

absl::StatusOr<TetMesh> TetMeshFromFile(TetFile file) {
  if (file.tetrahedra.empty()) {
    return absl::InvalidArgumentError("no tetrahedra in this file (a surface is read as `mesh`)");
  }
  TetMesh mesh;
  mesh.warnings = std::move(file.warnings);
  for (const TetFile::Element& element : file.tetrahedra) {
    const absl::StatusOr<Tetrahedron> tetrahedron = Oriented(element, file.nodes);
    if (!tetrahedron.ok()) return tetrahedron.status();
    mesh.tetrahedra.push_back(*tetrahedron);
    mesh.label.push_back(element.label);
    mesh.group.push_back(element.group);
  }
  mesh.fill.assign(mesh.tetrahedra.size(), 1);
  mesh.group_names = file.group_names;
  if (absl::Status s = CheckFaces(file, mesh.tetrahedra); !s.ok()) return s;
  const std::vector<std::int32_t> number = KeepUsedNodes(&file, &mesh);
  if (absl::Status s = AddNodeGroups(file, number, &mesh); !s.ok()) return s;
  mesh.surface.triangles = BoundaryTriangles(mesh.tetrahedra);
  PutSurfaceFirst(&mesh);
  return mesh;
}

bool IsTetMeshName(const std::string& path) {
  const std::string extension = Extension(path);
  return extension == "msh" || extension == "vtk";
}

absl::StatusOr<TetMesh> ReadTetMesh(const std::string& path) {
  const auto error = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", what));
  };
  const bool is_pml = Extension(path) == "pml";
  if (!is_pml && !IsTetMeshName(path)) {
    return error("tetrahedra are read from .msh, .pml and .vtk files");
  }
  const absl::StatusOr<std::string> bytes = ReadFile(path, kMaxMeshBytes);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<TetMesh> mesh = is_pml                     ? ReadPmlTets(*bytes)
                                 : Extension(path) == "msh" ? ParseGmsh(*bytes)
                                                            : ParseVtk(*bytes);
  if (!mesh.ok()) return error(mesh.status().message());
  return mesh;
}

}  // namespace adhesim
