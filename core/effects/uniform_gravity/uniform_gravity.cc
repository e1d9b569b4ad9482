#include "core/effects/uniform_gravity/uniform_gravity.h"

#include "core/effects/registry.h"

namespace adhesim {

UniformGravityEffect::UniformGravityEffect(const Model& model, const v1::UniformGravity& message)
    : model_(model),
      bodies_(SelectBodies(model, message.bodies(), [](const Body& b) { return !b.all_fixed; })),
      acceleration_m_s2_(message.acceleration_m_s2().data()) {}

double UniformGravityEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  for (int b : bodies_) {
    if (in.Sleeps(b)) continue;
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      out.field[p] += model_.mass_kg[p] * acceleration_m_s2_;
    }
  }
  return 0;
}

}  // namespace adhesim
