#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/model/geometry.h"
#include "core/model/model.h"

namespace adhesim {

// Far beyond what runs in real time. The limits keep a slip of the keyboard (a sheet of a thousand
// by a thousand, a hundred times) from exhausting the machine's memory.
constexpr int kMaxParticles = 1'000'000;
constexpr int kMaxTetrahedra = 8'000'000;

// Nodes of a mesh that its file gives a name.
struct NodeGroup {
  std::string name;
  std::vector<std::int32_t> nodes;  // ascending
};

// What a body is made from, before it becomes particles: a surface and, in bodies that are elastic
// inside, tetrahedra.
struct TetMesh {
  TriangleMesh surface;  // vertices: all nodes [m], those of triangles first; triangles: outward
  std::vector<Tetrahedron> tetrahedra;   // of nodes; positive (see model.h); empty: surface only
  std::vector<double> fill;              // [#tetrahedra] part of it inside the surface, above 0
  std::vector<std::int32_t> label;       // [#tetrahedra] -1: none
  std::vector<std::int32_t> group;       // [#tetrahedra] into `group_names`; -1: none
  std::vector<std::string> group_names;  // of tetrahedra
  std::vector<NodeGroup> node_groups;    // of parts of the surface
  std::vector<CarriedParticle> carried;  // nodes that belong to no tetrahedron, ascending
  std::vector<std::string> warnings;     // what a reader or mesher thought better of
};

// The volume of a tetrahedron; negative when its corners are the wrong way round [m^3].
inline double TetVolume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return (b - a).cross(c - a).dot(d - a) / 6;
}
inline double TetVolume(std::span<const Vec3> nodes, const Tetrahedron& t) {
  return TetVolume(nodes[t[0]], nodes[t[1]], nodes[t[2]], nodes[t[3]]);
}

// The volume inside the surface: of the tetrahedra as far as they are filled [m^3].
double FilledVolume(const TetMesh& mesh);

// Corners of the four faces of a positive tetrahedron, counter-clockwise from outside; face k lies
// opposite corner k.
inline constexpr int kTetFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

// A face of a tetrahedron and the same face whatever its first corner and its direction.
struct TetFace {
  Triangle sorted;  // ascending corners
  Triangle around;  // counter-clockwise from outside the tetrahedron
  std::int32_t tetrahedron;
};

// The faces of all tetrahedra by (sorted, tetrahedron): the same face of two tetrahedra is
// consecutive.
std::vector<TetFace> SortedFaces(std::span<const Tetrahedron> tetrahedra);

// The faces that only one tetrahedron has, outward, in the tetrahedra's order.
std::vector<Triangle> BoundaryTriangles(std::span<const Tetrahedron> tetrahedra);

// Renumbers the nodes so that those of the surface come first, otherwise in their order. Not for
// meshes that carry.
void PutSurfaceFirst(TetMesh* mesh);

}  // namespace adhesim
