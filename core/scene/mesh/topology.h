#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// One side of a triangle, named by its ends in ascending order.
struct TriangleSide {
  std::int32_t low = 0, high = 0;  // vertices, low < high
  std::int32_t triangle = 0;
  bool ascending = true;  // the triangle runs from low to high
};

// The sides of all triangles, ascending by (low, high, triangle): the sides of one edge are
// consecutive.
std::vector<TriangleSide> SortedSides(std::span<const Triangle> triangles);

// Calls visit(span of sides) once per edge, in ascending order of the edges.
template <typename Visit>
void ForEachEdge(std::span<const TriangleSide> sides, Visit visit) {
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t last = first + 1;
    while (last < sides.size() && sides[last].low == sides[first].low &&
           sides[last].high == sides[first].high) {
      ++last;
    }
    visit(sides.subspan(first, last - first));
    first = last;
  }
}

// Lists of numbers per element: those of i are values[start[i] .. start[i + 1]), ascending.
struct IndexLists {
  std::vector<std::int32_t> start;  // [#elements + 1]
  std::vector<std::int32_t> values;
};

// Vertices joined to each vertex by an edge.
IndexLists VertexNeighbours(std::span<const TriangleSide> sides, int vertex_count);

// Triangles at each vertex.
IndexLists IncidentTriangles(std::span<const Triangle> triangles, int vertex_count);

// 1 for each vertex of an edge that only one triangle has.
std::vector<std::uint8_t> BoundaryVertices(std::span<const TriangleSide> sides, int vertex_count);

// Which way the triangles of each piece face. Triangles belong to a piece when a chain of edges
// with two triangles joins them.
struct Facing {
  std::vector<std::int32_t> piece;    // [#triangles] number of its piece
  std::vector<std::uint8_t> flipped;  // [#triangles] 1: the other way than most of its piece
  std::int32_t pieces = 0;
  bool one_sided = false;  // some piece has no two sides (a Moebius strip)
};
Facing FindFacing(std::span<const TriangleSide> sides, int triangle_count);

// Area vector: half the cross product of two sides; its direction is the normal [m^2].
inline Vec3 AreaVector(const Vec3& a, const Vec3& b, const Vec3& c) {
  return 0.5 * (b - a).cross(c - a);
}

// False for a triangle without a usable normal: its height is below 1e-10 of its longest side, four
// decades above the rounding of doubles and well below any sliver that a file in single precision
// can mean. False for a NaN from an overflow, too.
bool HasArea(const Vec3& a, const Vec3& b, const Vec3& c);

// Volume enclosed by a closed surface; negative when its triangles are clockwise from outside
// [m^3].
double EnclosedVolume(const TriangleMesh& mesh);

}  // namespace adhesim
