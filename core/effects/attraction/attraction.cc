#include "core/effects/attraction/attraction.h"

#include <algorithm>
#include <cmath>

#include "core/effects/registry.h"

namespace adhesim {

AttractionEffect::AttractionEffect(const Model& model, const v1::Attraction& message)
    : model_(model),
      bodies_(SelectBodies(model, message.bodies(), [](const Body& b) { return !b.all_fixed; })),
      point_m_(message.point_m().data()),
      acceleration_m_s2_(message.acceleration_m_s2()),
      core_radius_m_(message.core_radius_m()) {}

double AttractionEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  for (int b : bodies_) {
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      const Vec3 towards = point_m_ - in.position_m[p];
      const double distance = std::max(towards.norm(), core_radius_m_);
      out.field[p] += (model_.mass_kg[p] * acceleration_m_s2_ / distance) * towards;
    }
  }
  return 0;
}

void AttractionEffect::AddBounds(std::span<double> stiffness_n_m, std::span<double>) const {
  for (int b : bodies_) {
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      stiffness_n_m[p] += model_.mass_kg[p] * std::abs(acceleration_m_s2_) / core_radius_m_;
    }
  }
}

}  // namespace adhesim
