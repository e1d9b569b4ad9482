#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "core/scene/mesh/tet_mesh.h"

namespace adhesim {

// What a mesh of tetrahedra is; lengths in its own unit (m for bodies).
struct TetReport {
  int nodes = 0;  // of tetrahedra
  int carried = 0;
  int tetrahedra = 0;
  int components = 0;    // connected through faces
  double volume_m3 = 0;  // of all tetrahedra
  double filled_m3 = 0;  // of what is inside the surface
  double min_dihedral_deg = 0;
  double max_dihedral_deg = 0;
  double min_radius_ratio = 0;  // three times the inner by the outer radius: 1 when regular
  double mean_radius_ratio = 0;
  double min_edge_m = 0;
  std::map<std::int32_t, double> label_m3;  // filled volume of each label
  std::map<std::string, double> group_m3;   // of each group
};
TetReport MeasureTets(const TetMesh& mesh);

// A tissue of linear elasticity.
struct TissueMaterial {
  double young_modulus_pa = 5400;  // liver
  double poisson_ratio = 0.45;
  double density_kg_m3 = 1060;
};

// An explicit step (symplectic Euler, lumped masses) that is stable: 2 / w, where w is the highest
// frequency of any tetrahedron by itself; no frequency of the mesh is above it (Irons, Treharne
// 1971). It is on the safe side, by some ten to forty per cent. Fill cancels.
double StableStep(const TetMesh& mesh, const TissueMaterial& material);

}  // namespace adhesim
