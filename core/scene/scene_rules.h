#pragma once

#include "adhesim/v1/scene.pb.h"
#include "core/scene/problem.h"

namespace adhesim {

// Rules that tie several fields of a scene together: unique names, order of waypoints, unit
// quaternions, strengths that exclude each other, effects that would act twice on one body. Fields
// whose own value is wrong are skipped where the rule could not be told apart from that. Part of
// ValidateScene.
void CheckSceneRules(const v1::Scene& scene, Problems* problems);

}  // namespace adhesim
