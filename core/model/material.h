#pragma once

#include "adhesim/v1/scene.pb.h"
#include "core/model/model.h"

namespace adhesim {

// Elastic constants.
struct Material {
  double young_modulus_pa = 0;
  double poisson_ratio = 0;
};

// Whether a region holds a tetrahedron: by its centre at rest, its label or its group. Regions that
// are about surfaces (`border`) hold none.
bool HoldsTetrahedron(const v1::Region& region, const Model& model, int tetrahedron);

// What a tetrahedron is made of: the last region that holds it counts.
Material MaterialOf(const v1::Elasticity& elasticity, const Model& model, int tetrahedron);

// True when the effect's message acts on the body.
bool ActsOn(const v1::Elasticity& elasticity, const Body& body);

// [#particles] (1 - nu^2) / E of the tissue at each particle, the mean over its tetrahedra (carried
// particles: over those of their carriers), 1/Pa; 0 where there is none: rigid.
std::vector<double> CompliancesOf(const Model& model);

}  // namespace adhesim
