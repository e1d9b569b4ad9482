#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/mesh/tet_mesh.h"

namespace adhesim {

// Reads the tetrahedra in a Gmsh (.msh, formats 2.2 and 4.1), a legacy VTK (.vtk, unstructured
// grid), text or binary, or a PML file, in the file's own unit.
//
// Triangles, lines and points beside the tetrahedra are no part of the body; every other element
// (of second order too) is refused. Gmsh: physical groups of volumes are the tetrahedra's groups,
// and their numbers the labels; physical groups of surfaces are node groups; one without a name is
// named by its number. VTK: the first array of whole numbers of the cells is their label. PML: all
// tetrahedra of exclusive components, whose names are the tetrahedra's groups; every component of
// atoms or faces is a node group.
//
// The tetrahedra's faces that no other has are the surface. Tetrahedra that are the wrong way round
// are turned. Errors name file and line, byte or element: no tetrahedron; one without volume, with
// a node that does not exist, twice in the file; more than two at a face. Nodes that no tetrahedron
// has are left out with a warning.
absl::StatusOr<TetMesh> ReadTetMesh(const std::string& path);

// The formats, on the bytes of a file that others wrote.
absl::StatusOr<TetMesh> ParseGmsh(absl::string_view bytes);
absl::StatusOr<TetMesh> ParseVtk(absl::string_view bytes);
struct PmlModel;
absl::StatusOr<TetMesh> TetMeshOfPml(const PmlModel& model);

// True when a file's name ends like one that holds tetrahedra only: .msh, .vtk.
bool IsTetMeshName(const std::string& path);

// What a file says, before it is examined.
struct TetFile {
  struct Element {
    std::int64_t number = 0;              // in the file, for messages
    std::int64_t line = 0;                // likewise; 0: not known
    std::array<std::int64_t, 4> nodes{};  // into `nodes`; anything, when the file is wrong
    std::int32_t label = -1;
    std::int32_t group = -1;  // into `group_names` (triangles: `surface_names`)
  };
  std::vector<Vec3> nodes;
  std::vector<Element> tetrahedra;
  std::vector<Element> triangles;  // in groups; three nodes
  std::vector<std::string> group_names, surface_names;
  std::vector<NodeGroup> node_groups;  // beside those of triangles; nodes in any order
  std::vector<std::string> warnings;
};
absl::StatusOr<TetMesh> TetMeshFromFile(TetFile file);

}  // namespace adhesim
