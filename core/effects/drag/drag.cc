#include "core/effects/drag/drag.h"

#include "core/effects/registry.h"

namespace adhesim {

DragEffect::DragEffect(const Model& model, const v1::Drag& message)
    : model_(model),
      bodies_(SelectBodies(model, message.bodies(), [](const Body& b) { return !b.all_fixed; })),
      rate_per_s_(message.rate_per_s()) {}

double DragEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  for (int b : bodies_) {
    if (in.Sleeps(b)) continue;
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      out.drag[p] -= (rate_per_s_ * model_.mass_kg[p]) * in.velocity_m_s[p];
    }
  }
  return 0;
}

void DragEffect::AddBounds(std::span<double>, std::span<double> damping_n_s_m) const {
  for (int b : bodies_) {
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      damping_n_s_m[p] += rate_per_s_ * model_.mass_kg[p];
    }
  }
}

}  // namespace adhesim
