#pragma once

#include "core/model/geometry.h"
#include "core/scene/mesh/winding_number.h"

namespace adhesim {

// The surface without triangles that have no area or repeat another, and without vertices that are
// in none; the triangles of a piece all face the same way (that of most of them).
TriangleMesh CleanSurface(const TriangleMesh& surface);

// Turns every piece of a cleaned surface such that its triangles have the inside (fill_cells.h)
// behind them. `winding` is the surface's own. False when no triangle has the inside on one side
// only: the surface encloses nothing.
bool FaceOutward(const WindingNumber& winding, TriangleMesh* surface);

}  // namespace adhesim
