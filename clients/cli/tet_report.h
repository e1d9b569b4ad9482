#pragma once

#include <string>

#include "clients/cli/output.h"
#include "core/scene/mesh/measure_tets.h"

namespace adhesim {

// What `mesh info` says about tetrahedra, for programs and for people. Lengths in metres.
Json TetsToJson(const TetMesh& mesh, const TissueMaterial& material);
std::string TetsToText(const TetMesh& mesh, const TissueMaterial& material);

}  // namespace adhesim
