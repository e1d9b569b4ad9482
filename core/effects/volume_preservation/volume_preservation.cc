#include "core/effects/volume_preservation/volume_preservation.h"

#include "core/effects/registry.h"
#include "core/model/volume.h"

namespace adhesim {

VolumePreservationEffect::VolumePreservationEffect(const Model& model,
                                                   const v1::VolumePreservation& message)
    : model_(model) {
  bodies_ = SelectBodies(model, message.bodies(), [](const Body& b) {
    return b.closed && !b.rigid && !b.all_fixed && b.tetrahedron_count == 0;
  });
  for (int b : bodies_) {
    const Body& body = model.bodies[b];
    rows_.push_back({body.first_particle, body.particle_count, body.rest_volume_m3});
  }
}

void VolumePreservationEffect::ConstraintResiduals(std::span<const Vec3> position_m,
                                                   std::span<const std::uint8_t> asleep,
                                                   std::span<double> residual) const {
  for (std::size_t r = 0; r < bodies_.size(); ++r) {
    if (!asleep.empty() && asleep[bodies_[r]]) continue;
    const Body& body = model_.bodies[bodies_[r]];
    residual[r] = EnclosedVolume(model_, body, position_m) - body.rest_volume_m3;
  }
}

void VolumePreservationEffect::ConstraintGradients(std::span<const Vec3> position_m,
                                                   std::span<const std::uint8_t> asleep,
                                                   std::span<Vec3> gradient) const {
  for (int b : bodies_) {
    if (!asleep.empty() && asleep[b]) continue;
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      gradient[p].setZero();
    }
    for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
      const Triangle& tri = model_.triangles[t];
      const Vec3 a = position_m[tri[0]];
      const Vec3 normal = (1.0 / 6) * (position_m[tri[1]] - a).cross(position_m[tri[2]] - a);
      for (int p : tri) gradient[p] += normal;
    }
  }
}

}  // namespace adhesim
