#pragma once

#include "core/effects/contact_effect.h"

namespace adhesim {

// A spring and a damper between a particle and another body's surface (README.md). With the depth
// d = thickness - gap > 0 and the normal n from the surface to the particle,
//
//   U = 1/2 k d^2,   f = k d n + max(-c v_n, -k d) n   on the particle, -f on the surface:
//
// it pushes and never pulls.
class PenaltyEffect : public ContactEffect {
 public:
  PenaltyEffect(const Model& model, const v1::Penalty& message);

  std::string_view name() const override { return "penalty"; }
  unsigned force_kinds() const override { return kElastic | (damping_n_s_m_ > 0 ? kDamping : 0u); }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;
  double contact_reach_m() const override { return 2 * thickness_m_; }

 private:
  double thickness_m_;
  double stiffness_n_m_;
  double damping_n_s_m_;
};

}  // namespace adhesim
