#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/model/model.h"

namespace adhesim {

// A scene whose end is known in closed form: one block of tissue along x, held at its lower x face,
// that bends under its own weight along z. The deflection of its free end, once it rests, is that
// of Timoshenko's beam: w L^4 / 8EI + w L^2 / 2 kappa G A, w = rho g A, kappa 5/6.
struct BeamFormula {
  double deflection_m = 0;
  std::string text;  // the formula and where it comes from
};

// Nothing where the scene is no such beam, or where the closed form does not hold: deflections
// above 2 % of the length.
std::optional<BeamFormula> BeamOf(const Model& model);

// Mean deflection of the free end face, by its area; against z. Of a model that BeamOf knows.
double BeamEndDeflection(const Model& model, std::span<const Vec3> position_m);

}  // namespace adhesim
