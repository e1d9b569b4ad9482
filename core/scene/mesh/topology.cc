#include "core/scene/mesh/topology.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace adhesim {
namespace {

// Groups (element, value) pairs by element, values ascending.
IndexLists Group(std::vector<std::pair<std::int32_t, std::int32_t>> pairs, int element_count) {
  std::sort(pairs.begin(), pairs.end());
  IndexLists lists;
  lists.start.assign(element_count + 1, 0);
  lists.values.reserve(pairs.size());
  for (const auto& [element, value] : pairs) {
    ++lists.start[element + 1];
    lists.values.push_back(value);
  }
  for (int i = 0; i < element_count; ++i) lists.start[i + 1] += lists.start[i];
  return lists;
}

}  // namespace

std::vector<TriangleSide> SortedSides(std::span<const Triangle> triangles) {
  std::vector<TriangleSide> sides;
  sides.reserve(triangles.size() * 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t from = triangles[t][k], to = triangles[t][(k + 1) % 3];
      sides.push_back(
          {std::min(from, to), std::max(from, to), static_cast<std::int32_t>(t), from < to});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const TriangleSide& a, const TriangleSide& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  return sides;
}

IndexLists VertexNeighbours(std::span<const TriangleSide> sides, int vertex_count) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  pairs.reserve(sides.size());
  ForEachEdge(sides, [&](std::span<const TriangleSide> edge) {
    pairs.emplace_back(edge[0].low, edge[0].high);
    pairs.emplace_back(edge[0].high, edge[0].low);
  });
  return Group(std::move(pairs), vertex_count);
}

IndexLists IncidentTriangles(std::span<const Triangle> triangles, int vertex_count) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  pairs.reserve(triangles.size() * 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const std::int32_t v : triangles[t]) pairs.emplace_back(v, static_cast<std::int32_t>(t));
  }
  return Group(std::move(pairs), vertex_count);
}

std::vector<std::uint8_t> BoundaryVertices(std::span<const TriangleSide> sides, int vertex_count) {
  std::vector<std::uint8_t> boundary(vertex_count, 0);
  ForEachEdge(sides, [&](std::span<const TriangleSide> edge) {
    if (edge.size() == 1) boundary[edge[0].low] = boundary[edge[0].high] = 1;
  });
  return boundary;
}

Facing FindFacing(std::span<const TriangleSide> sides, int triangle_count) {
  std::vector<std::vector<std::pair<std::int32_t, bool>>> across(
      triangle_count);  // (triangle, same way along the edge)
  ForEachEdge(sides, [&](std::span<const TriangleSide> edge) {
    if (edge.size() != 2) return;
    const bool clash = edge[0].ascending == edge[1].ascending;
    across[edge[0].triangle].emplace_back(edge[1].triangle, clash);
    across[edge[1].triangle].emplace_back(edge[0].triangle, clash);
  });
  Facing facing;
  facing.piece.assign(triangle_count, -1);
  facing.flipped.assign(triangle_count, 0);
  std::vector<std::int32_t> members;
  for (std::int32_t start = 0; start < triangle_count; ++start) {
    if (facing.piece[start] >= 0) continue;
    members = {start};
    facing.piece[start] = facing.pieces;
    std::size_t turned_count = 0;  // that face the other way than the first one
    for (std::size_t i = 0; i < members.size(); ++i) {
      for (const auto& [other, clash] : across[members[i]]) {
        const std::uint8_t turned = facing.flipped[members[i]] ^ (clash ? 1 : 0);
        if (facing.piece[other] < 0) {
          facing.piece[other] = facing.pieces;
          facing.flipped[other] = turned;
          turned_count += turned;
          members.push_back(other);
        } else if (facing.flipped[other] != turned) {
          facing.one_sided = true;
        }
      }
    }
    if (2 * turned_count > members.size()) {
      for (const std::int32_t t : members) facing.flipped[t] ^= 1;
    }
    ++facing.pieces;
  }
  return facing;
}

bool HasArea(const Vec3& a, const Vec3& b, const Vec3& c) {
  constexpr double kNoArea = 1e-10;
  const double longest_sq =
      std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return 2 * AreaVector(a, b, c).norm() > kNoArea * longest_sq;
}

double EnclosedVolume(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) return 0;
  // Tetrahedra from a vertex of the mesh itself: no cancellation when the mesh is far from the
  // origin.
  const Vec3& o = mesh.vertices[0];
  double six_volumes = 0;
  for (const auto [a, b, c] : mesh.triangles) {
    six_volumes += (mesh.vertices[a] - o).dot((mesh.vertices[b] - o).cross(mesh.vertices[c] - o));
  }
  return six_volumes / 6;
}

}  // namespace adhesim
