#pragma once

#include <string>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// What a surface is. Counts are of the mesh as given; lengths in its own unit (m for bodies).
struct MeshReport {
  int vertices = 0;
  int triangles = 0;
  int edges = 0;
  int components = 0;             // pieces connected through shared vertices
  int boundary_edges = 0;         // of one triangle only
  int non_manifold_edges = 0;     // of more than two triangles
  int non_manifold_vertices = 0;  // where several fans of triangles touch in one point
  int inconsistent_edges = 0;     // whose two triangles run the same way along them
  int degenerate_triangles = 0;   // a repeated vertex, or no area
  int duplicate_triangles = 0;    // the same three vertices as an earlier triangle
  int unused_vertices = 0;        // in no triangle
  int bad_numbers = 0;            // vertices that are NaN or infinite
  int bad_indices = 0;            // triangles that name a vertex that does not exist
  bool closed = false;            // every edge has exactly two triangles
  bool manifold = false;  // a surface (with or without boundary) around every edge and vertex
  bool oriented = false;  // neighbouring triangles agree which side is outside
  double min_edge_m = 0;
  double max_edge_m = 0;
  double min_angle_deg = 0;  // smallest angle of any triangle
  double area_m2 = 0;
  double volume_m3 = 0;  // enclosed; 0 unless closed and oriented; negative: inside out
  Aabb box;
  int euler_characteristic = 0;  // vertices in use - edges + triangles
  int genus = -1;                // number of handles; -1 unless closed, manifold and oriented
};

// One reason (or doubt) why a surface cannot be the surface of a body.
struct MeshFlaw {
  std::string message;  // what, which (the first few and their number), how to mend it
  bool warning = false;
};

struct MeshCheck {
  MeshReport report;
  std::vector<MeshFlaw> flaws;  // empty: fit to be a body
};

// Examines a surface; nothing about it is taken for granted. A consequence of a flaw is not a flaw
// of its own: one mistake in a file gives one message. Time: O(n log n).
MeshCheck CheckMesh(const TriangleMesh& mesh);

}  // namespace adhesim
