#pragma once

#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// f_i = m_i g.
class UniformGravityEffect : public Effect {
 public:
  UniformGravityEffect(const Model& model, const v1::UniformGravity& message);

  std::string_view name() const override { return "uniform_gravity"; }
  bool lets_sleep() const override { return true; }
  unsigned force_kinds() const override { return kField; }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;

 private:
  const Model& model_;
  std::vector<int> bodies_;
  Vec3 acceleration_m_s2_;
};

}  // namespace adhesim
