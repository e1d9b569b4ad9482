#pragma once

#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// f_i = m_i a (p - x_i) / max(|p - x_i|, core): a constant pull towards a point p (chemotaxis of
// cells; Carra et al. 2007, section 5), linear within the core so that it is continuous at p.
// External: it does work.
class AttractionEffect : public Effect {
 public:
  AttractionEffect(const Model& model, const v1::Attraction& message);

  std::string_view name() const override { return "attraction"; }
  unsigned force_kinds() const override { return kField; }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;

 private:
  const Model& model_;
  std::vector<int> bodies_;
  Vec3 point_m_;
  double acceleration_m_s2_;
  double core_radius_m_;
};

}  // namespace adhesim
