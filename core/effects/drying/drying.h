#pragma once

#include "core/model/effect.h"

namespace adhesim {

// An adhesive that dries: a bond of the age a carries
//   s(a) = s_0 (1 + (g - 1) (1 - exp(-a / tau)))
// with s_0 what the adhesive alone carries [N], g the gain [1] and tau the time constant [s]. First
// order kinetics without a temperature (README.md).
class DryingEffect : public Effect {
 public:
  DryingEffect(const Model& model, const v1::Drying& message);

  std::string_view name() const override { return "drying"; }
  // What grows weaker lets go while nothing moves.
  bool lets_sleep() const override { return gain_ >= 1; }
  bool scales_strengths() const override { return true; }
  void ScaleStrengths(double time_s, std::span<Bond> bonds) const override;

 private:
  double gain_;
  double time_constant_s_;
};

}  // namespace adhesim
