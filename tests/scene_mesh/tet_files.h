#pragma once

#include <map>
#include <string>

#include "core/scene/mesh/tet_mesh.h"

namespace adhesim {

// A block of 2 x 1 x 1 in two groups, 7 "left" and 9 (without a name), which are the labels too,
// and a group "base" of the triangles at the bottom.
TetMesh GroupedBlock();

// The bytes of GroupedBlock() in every dialect, by file name. VTK has the labels only. Some
// tetrahedra are written the wrong way round, and one node is used by nothing.
std::map<std::string, std::string> InEveryTetFormat();

}  // namespace adhesim
