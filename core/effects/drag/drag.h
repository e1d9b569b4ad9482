#pragma once

#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// f_i = -c m_i v_i: the resistance of a fluid at rest; a free particle loses its velocity at the
// rate c [1/s].
class DragEffect : public Effect {
 public:
  DragEffect(const Model& model, const v1::Drag& message);

  std::string_view name() const override { return "drag"; }
  bool lets_sleep() const override { return true; }
  unsigned force_kinds() const override { return kDrag; }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;

 private:
  const Model& model_;
  std::vector<int> bodies_;
  double rate_per_s_;
};

}  // namespace adhesim
