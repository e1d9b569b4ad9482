#include "core/study/bodies_energy.h"

#include <array>
#include <utility>

#include "core/effects/registry.h"

namespace adhesim {

absl::StatusOr<BodiesEnergy> BodiesEnergy::Create(const Model& model) {
  BodiesEnergy energy;
  energy.particles_ = model.particle_count();
  int first = 0;
  for (const v1::Effect& message : model.scene.effects()) {
    if (message.has_virtual_adhesive()) continue;  // constraints, without a potential
    absl::StatusOr<std::unique_ptr<Effect>> effect = MakeEffect(model, message);
    if (!effect.ok()) return effect.status();
    const int state_size = (*effect)->state_size();
    if ((*effect)->contact_reach_m() > 0) {
      energy.contact_by_effects_ = true;
    } else if ((*effect)->force_kinds() & kElastic) {
      energy.elasticities_.push_back({*std::move(effect), first});
    }
    first += state_size;
  }
  return energy;
}

double BodiesEnergy::Of(const State& state) const {
  // On copies: forces are evaluated for their energy only.
  std::vector<double> effect_state = state.effect_state;
  std::array<std::vector<Vec3>, kForceKinds> force;
  for (std::vector<Vec3>& of : force) of.assign(static_cast<std::size_t>(particles_), Vec3::Zero());
  Parallel one(1);
  double energy_j = state.ledger.kinetic_j;
  for (const Elasticity& elasticity : elasticities_) {
    const std::span<double> own =
        std::span(effect_state).subspan(elasticity.first, elasticity.effect->state_size());
    energy_j += elasticity.effect->AddForces(
        {state.position_m, state.velocity_m_s, state.time_s, own, &one},
        {force[0], force[1], force[2], force[3]});
  }
  return energy_j;
}

}  // namespace adhesim
