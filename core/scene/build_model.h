#pragma once

#include <memory>
#include <string>

#include "adhesim/v1/scene.pb.h"
#include "core/model/model.h"
#include "core/scene/problem.h"

namespace adhesim {

// What became of a scene: a model when no problem is more than a warning.
struct BuiltModel {
  std::shared_ptr<const Model> model;
  Problems problems;
};

// Makes the model of a validated scene (defaults filled in): reads or generates every surface,
// places it, spreads the masses, finds neighbours and fixed particles. Files are relative to
// `directory`. Reports every problem at once.
BuiltModel BuildModel(const v1::Scene& scene, const std::string& directory);

// Finds the particles and triangles around every particle from the model's triangles.
void BuildConnectivity(Model* model);

}  // namespace adhesim
