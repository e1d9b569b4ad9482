#include "core/effects/attraction_impulses/attraction_impulses.h"

#include <algorithm>

namespace adhesim {

AttractionImpulsesEffect::AttractionImpulsesEffect(const Model& model,
                                                   const v1::AttractionImpulses& message)
    : ContactEffect(model),
      stick_distance_m_(message.stick_distance_m()),
      stick_stiffness_n_m_(message.stick_stiffness_n_m()),
      contact_stiffness_n_m_(message.contact_stiffness_n_m()) {}

double AttractionImpulsesEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  BeginEvaluation();
  const double s = stick_distance_m_, k = stick_stiffness_n_m_;
  double sum_j = 0;
  for (const NearPair& pair : in.near) {
    const Vec3 offset =
        in.position_m[pair.particle] - AtPoint(pair.triangle, pair.weights, in.position_m);
    const double d = pair.normal.dot(offset);
    if (d >= s) continue;
    double force_n, energy_j = -k * s * s / 6;
    if (d > 0) {
      force_n = -k * d * (1 - d / s);
      energy_j += k * d * d * (0.5 - d / (3 * s));
    } else {
      force_n = -contact_stiffness_n_m_ * d;
      energy_j += 0.5 * contact_stiffness_n_m_ * d * d;
    }
    energy_j_[pair.particle] += energy_j;
    sum_j += energy_j;
    AddPair(pair.particle, pair.triangle, pair.weights, force_n * pair.normal, out.elastic);
  }
  return sum_j;
}

void AttractionImpulsesEffect::AddBounds(std::span<double> stiffness_n_m, std::span<double>) const {
  AddPairBounds(std::max(stick_stiffness_n_m_, contact_stiffness_n_m_), stiffness_n_m);
}

}  // namespace adhesim
