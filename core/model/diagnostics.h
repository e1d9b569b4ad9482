#pragma once

#include <optional>

#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Figures that tell how well a run kept what it should keep (physics notes 3.7).

// E_ref = max(T + U_elastic) + sum|W_ext| + sum|W_tool|, J: what energy errors are relative to.
double EnergyReference(const Ledger& ledger);

// Largest imbalance of the energy ledger in one sub-step over E_ref; 0 when nothing ever had
// energy.
double IdentityError(const Ledger& ledger);

struct MomentumError {
  double linear = 0;   // |P - P_0 - sum of impulses| / max sum m|v|
  double angular = 0;  // the same of L about the world's origin / max sum m|r||v|
};

// Balance of momentum now; 0 where nothing ever moved by more than round-off.
MomentumError MomentumBalance(const Model& model, const State& state);

// Largest |V - V_rest| / V_rest among the bodies that the scene's volume preservation acts on;
// empty: it acts on none.
std::optional<double> VolumeError(const Model& model, const State& state);

}  // namespace adhesim
