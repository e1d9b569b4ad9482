#include "core/effects/penalty/penalty.h"

#include <algorithm>

namespace adhesim {

PenaltyEffect::PenaltyEffect(const Model& model, const v1::Penalty& message)
    : ContactEffect(model),
      thickness_m_(message.thickness_m()),
      stiffness_n_m_(message.stiffness_n_m()),
      damping_n_s_m_(message.damping_n_s_m()) {}

double PenaltyEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  BeginEvaluation();
  double sum_j = 0;
  for (const NearPair& pair : in.near) {
    const Vec3 offset =
        in.position_m[pair.particle] - AtPoint(pair.triangle, pair.weights, in.position_m);
    const double depth_m = thickness_m_ - pair.normal.dot(offset);
    if (depth_m <= 0) continue;
    const double push_n = stiffness_n_m_ * depth_m;
    const double energy_j = 0.5 * push_n * depth_m;
    energy_j_[pair.particle] += energy_j;
    sum_j += energy_j;
    AddPair(pair.particle, pair.triangle, pair.weights, push_n * pair.normal, out.elastic);
    if (damping_n_s_m_ <= 0) continue;
    const Vec3 velocity =
        in.velocity_m_s[pair.particle] - AtPoint(pair.triangle, pair.weights, in.velocity_m_s);
    const double damping_n = std::max(-damping_n_s_m_ * pair.normal.dot(velocity), -push_n);
    AddPair(pair.particle, pair.triangle, pair.weights, damping_n * pair.normal, out.damping);
  }
  return sum_j;
}

void PenaltyEffect::AddBounds(std::span<double> stiffness_n_m,
                              std::span<double> damping_n_s_m) const {
  AddPairBounds(stiffness_n_m_, stiffness_n_m);
  AddPairBounds(damping_n_s_m_, damping_n_s_m);
}

}  // namespace adhesim
