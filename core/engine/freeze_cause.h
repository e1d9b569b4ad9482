#pragma once

#include <string>

#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// What is not finite in a state, and where: "position of particle 12 of body 'tissue' is not finite
// (and 40 more particles) after step 7 (0.035 s)"; empty when everything is finite.
std::string WhyNotFinite(const Model& model, const State& state);

}  // namespace adhesim
