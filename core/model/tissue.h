#pragma once

#include <cstdint>
#include <vector>

#include "adhesim/v1/scene.pb.h"
#include "core/model/model.h"

namespace adhesim {

// A material of tissue.
struct Material {
  double young_modulus_pa = 0;
  double poisson_ratio = 0;

  // Lame's constants, Pa.
  double mu() const { return young_modulus_pa / (2 * (1 + poisson_ratio)); }
  double lambda() const {
    return young_modulus_pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  }
};

// Whether a region holds a tetrahedron: by its centre at rest, its label or its group.
bool Holds(const v1::Region& region, const Model& model, int tetrahedron);

// The tetrahedra of the bodies that a message acts on, ascending.
std::vector<std::int32_t> TetrahedraOf(const v1::Elasticity& elasticity, const Model& model);

// The last region of the message that holds a tetrahedron; -1: none does.
int RegionOf(const v1::Elasticity& elasticity, const Model& model, int tetrahedron);

// The material of a tetrahedron that the message acts on.
Material MaterialOf(const v1::Elasticity& elasticity, const Model& model, int tetrahedron);

// [#particles] (1 - nu^2) / E of the tissue at each particle, the mean over its tetrahedra (carried
// particles: over those of their carriers), 1/Pa; 0 where there is none: rigid.
std::vector<double> CompliancesOf(const Model& model);

}  // namespace adhesim
