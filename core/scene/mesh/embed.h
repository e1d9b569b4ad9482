#pragma once

#include <absl/status/statusor.h>

#include "core/scene/mesh/fill_cells.h"
#include "core/scene/mesh/tet_mesh.h"

namespace adhesim {

// A tetrahedron is filled at least that much: none of its nodes is without mass, and a shape that
// is thinner than the samples are apart still has a stiffness. What is filled less is left out
// where its neighbours can carry the surface in its place.
constexpr double kLeastFill = 0.05;

// Tetrahedra around and inside a surface: cubic cells, `cells` of them along the longest extent,
// five tetrahedra each (lattice.h). The surface's vertices come first and are carried: each moves
// with the tetrahedron that it lies in, or that it is outside of the least. `label_at` (may be
// empty) gives the tissue.
//
// Works for whatever encloses something: with holes, self-intersections, turned pieces, as a soup
// of triangles. The triangles are returned outward; those without area or that repeat another and
// vertices in none are left out; what is wrong with the surface is in `warnings`. Every tetrahedron
// is filled as far as samples of it are inside; the sum is kept when slivers are left out.
//
// Errors: no triangle, numbers that are not finite, indices out of range, nothing inside, more
// nodes than kMaxParticles.
absl::StatusOr<TetMesh> EmbedInLattice(const TriangleMesh& surface, int cells,
                                       const LabelAt& label_at = nullptr);

}  // namespace adhesim
