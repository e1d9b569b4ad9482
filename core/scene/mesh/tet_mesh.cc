#include "core/scene/mesh/tet_mesh.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace adhesim {

double FilledVolume(const TetMesh& mesh) {
  double sum_m3 = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    sum_m3 += mesh.fill[t] * TetVolume(mesh.surface.vertices, mesh.tetrahedra[t]);
  }
  return sum_m3;
}

std::vector<TetFace> SortedFaces(std::span<const Tetrahedron> tetrahedra) {
  std::vector<TetFace> faces;
  faces.reserve(4 * tetrahedra.size());
  for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
    for (const auto& corners : kTetFaces) {
      const Triangle around = {tetrahedra[t][corners[0]], tetrahedra[t][corners[1]],
                               tetrahedra[t][corners[2]]};
      Triangle sorted = around;
      std::sort(sorted.begin(), sorted.end());
      faces.push_back({sorted, around, static_cast<std::int32_t>(t)});
    }
  }
  std::sort(faces.begin(), faces.end(), [](const TetFace& a, const TetFace& b) {
    return std::tie(a.sorted, a.tetrahedron) < std::tie(b.sorted, b.tetrahedron);
  });
  return faces;
}

std::vector<Triangle> BoundaryTriangles(std::span<const Tetrahedron> tetrahedra) {
  const std::vector<TetFace> faces = SortedFaces(tetrahedra);
  std::vector<TetFace> outside;
  for (std::size_t first = 0; first < faces.size();) {
    std::size_t last = first + 1;
    while (last < faces.size() && faces[last].sorted == faces[first].sorted) ++last;
    if (last == first + 1) outside.push_back(faces[first]);
    first = last;
  }
  std::stable_sort(outside.begin(), outside.end(), [](const TetFace& a, const TetFace& b) {
    return a.tetrahedron < b.tetrahedron;
  });
  std::vector<Triangle> triangles;
  triangles.reserve(outside.size());
  for (const TetFace& face : outside) triangles.push_back(face.around);
  return triangles;
}

void PutSurfaceFirst(TetMesh* mesh) {
  std::vector<Vec3>& nodes = mesh->surface.vertices;
  std::vector<std::uint8_t> outside(nodes.size(), 0);
  for (const Triangle& triangle : mesh->surface.triangles) {
    for (const std::int32_t node : triangle) outside[node] = 1;
  }
  std::vector<std::int32_t> number(nodes.size());
  std::vector<Vec3> sorted;
  sorted.reserve(nodes.size());
  for (const std::uint8_t wanted : {1, 0}) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (outside[i] != wanted) continue;
      number[i] = static_cast<std::int32_t>(sorted.size());
      sorted.push_back(nodes[i]);
    }
  }
  nodes = std::move(sorted);
  const auto renumber = [&](auto* indices) {
    for (std::int32_t& i : *indices) i = number[i];
  };
  for (Triangle& triangle : mesh->surface.triangles) renumber(&triangle);
  for (Tetrahedron& tetrahedron : mesh->tetrahedra) renumber(&tetrahedron);
  for (NodeGroup& group : mesh->node_groups) {
    renumber(&group.nodes);
    std::sort(group.nodes.begin(), group.nodes.end());
  }
}

}  // namespace adhesim
