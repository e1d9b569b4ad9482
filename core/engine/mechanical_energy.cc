#include <algorithm>

#include "core/engine/pipeline.h"

namespace adhesim {

double Pipeline::MechanicalEnergy() const {
  // On copies: forces are evaluated for their energy only. Near pairs are those of now; finding
  // them early changes no later step, since where forces need them every sub-step does so.
  StepReport report;
  std::span<const NearPair> near;
  const auto feels = [](const auto& effect) { return effect->contact_reach_m() > 0; };
  if (detector_ && std::any_of(effects_.begin(), effects_.end(), feels)) {
    detector_->Update(state_.position_m, &parallel_, &report);
    near = detector_->Find(state_.position_m, &parallel_);
  }
  std::array<std::vector<Vec3>, kForceKinds> force;
  for (int kind = 0; kind < kForceKinds; ++kind)
    force[kind].assign(force_n_[kind].size(), Vec3::Zero());
  std::vector<double> effect_state = state_.effect_state;
  const ForceOutput out{force[0], force[1], force[2], force[3]};
  return state_.ledger.kinetic_j + SumElasticEnergy(effect_state, near, out);
}

double Pipeline::SumElasticEnergy(std::span<double> effect_state, std::span<const NearPair> near,
                                  const ForceOutput& out) const {
  double elastic_j = 0;
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    const ForceInput in{
        state_.position_m, state_.velocity_m_s,
        state_.time_s,     effect_state.subspan(effect_state_first_[e], effects_[e]->state_size()),
        &parallel_,        near};
    elastic_j += effects_[e]->AddForces(in, out);
  }
  return elastic_j;
}

}  // namespace adhesim
