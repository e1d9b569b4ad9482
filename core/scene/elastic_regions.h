#pragma once

#include "core/model/model.h"
#include "core/scene/problem.h"

namespace adhesim {

// Reports the regions of effects `elasticity` that hold no tetrahedron, and effects that act on
// none.
void CheckElasticRegions(const v1::Scene& scene, const Model& model, Problems* problems);

}  // namespace adhesim
