#pragma once

#include "adhesim/v1/scene.pb.h"
#include "core/scene/problem.h"

namespace adhesim {

// Everything that is wrong with a scene before its files are read, from wherever the scene came:
// missing and non-finite values, ranges, sizes of lists, names, references, and fields that
// contradict each other. A scene without problems may be completed by WithDefaults and given to
// BuildModel.
Problems ValidateScene(const v1::Scene& scene);

// The scene with every default written out. What is absent and has no default stays absent (a
// body's `fixed`, a tool's `adhesion`); values that default to another field's
// (`release_distance_m`, shear strengths, a waypoint's orientation) are written too. An adhesive
// without strength keeps none: it never lets go.
v1::Scene WithDefaults(const v1::Scene& scene);

}  // namespace adhesim
