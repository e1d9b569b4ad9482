#pragma once

#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// The enclosed volume of each closed body stays at its value at rest: one constraint row a body,
// C(x) = 1/6 sum_t x_a . (x_b x x_c) - V_0, with gradient a third of the area-weighted normals
// around each particle. Both sums of the gradient, force and torque, vanish: the constraint
// conserves both momenta.
class VolumePreservationEffect : public Effect {
 public:
  VolumePreservationEffect(const Model& model, const v1::VolumePreservation& message);

  std::string_view name() const override { return "volume_preservation"; }
  bool lets_sleep() const override { return true; }
  std::span<const ConstraintRow> constraints() const override { return rows_; }
  void ConstraintResiduals(std::span<const Vec3> position_m, std::span<const std::uint8_t> asleep,
                           std::span<double> residual) const override;
  void ConstraintGradients(std::span<const Vec3> position_m, std::span<const std::uint8_t> asleep,
                           std::span<Vec3> gradient) const override;

 private:
  const Model& model_;
  std::vector<int> bodies_;  // [#rows]
  std::vector<ConstraintRow> rows_;
};

}  // namespace adhesim
