#pragma once

#include <memory>

#include "core/study/accuracy_study.h"

namespace adhesim {

// Bullet's deformable bodies on the diagrams of a scene, where they solve the same equations:
// tissue that nothing touches. What sticks they do not have, and their contact alone is another
// problem.
AccuracyRival BulletRival(std::shared_ptr<const Model> model, const DialOptions& options);

}  // namespace adhesim
