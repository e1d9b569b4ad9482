#include <algorithm>

#include "core/engine/pipeline.h"

namespace adhesim {

double Pipeline::MechanicalEnergy() const { return Energies().mechanical_j; }

double Pipeline::KeptEnergy() const {
  const EnergyNow now = Energies();
  return implicit_ ? now.mechanical_j : now.mechanical_j + 0.5 * substep_dt_s_ * now.elastic_w;
}

Pipeline::EnergyNow Pipeline::Energies() const {
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
  EnergyNow now;
  now.mechanical_j = state_.ledger.kinetic_j;
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    const ForceInput in{
        state_.position_m,
        state_.velocity_m_s,
        state_.time_s,
        std::span(effect_state).subspan(effect_state_first_[e], effects_[e]->state_size()),
        &parallel_,
        near};
    now.mechanical_j += effects_[e]->AddForces(in, out);
  }
  for (std::size_t p = 0; p < force[0].size(); ++p) {
    if (!model_->fixed[p]) now.elastic_w += force[0][p].dot(state_.velocity_m_s[p]);
  }
  return now;
}

}  // namespace adhesim
