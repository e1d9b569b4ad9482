// The part of a sub-step in which effects say how strong adhesion is.

#include "core/engine/pipeline.h"

namespace adhesim {

void Pipeline::ScaleStrengths() {
  for (Bond& bond : state_.contacts.bonds) bond.strength_scale = 1;
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    if (!effects_[e]->scales_strengths()) continue;
    effects_[e]->ScaleStrengths(state_.time_s, state_.contacts.bonds);
    clock_.Lap(effect_stage_[e]);
  }
}

}  // namespace adhesim
