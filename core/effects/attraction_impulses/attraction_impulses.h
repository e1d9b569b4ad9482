#pragma once

#include "core/effects/contact_effect.h"

namespace adhesim {

// Attraction of near surfaces by explicit impulses (README.md). At the gap d, the normal n from the
// surface to the particle:
//
//   I = -dt k d (1 - d / s) n    0 < d < s    attraction (Clavet et al. 2005)
//   I = -dt k_c d n              d <= 0       contact (ours)
//
// Both are dt times a force that has the energy U = k (d^2 / 2 - d^3 / 3 s) - w, 1/2 k_c d^2 - w
// inside, 0 beyond s: a well of depth w = k s^2 / 6.
class AttractionImpulsesEffect : public ContactEffect {
 public:
  AttractionImpulsesEffect(const Model& model, const v1::AttractionImpulses& message);

  std::string_view name() const override { return "attraction_impulses"; }
  unsigned force_kinds() const override { return kElastic; }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double>) const override;
  double contact_reach_m() const override { return 2 * stick_distance_m_; }

 private:
  double stick_distance_m_;
  double stick_stiffness_n_m_;
  double contact_stiffness_n_m_;
};

}  // namespace adhesim
