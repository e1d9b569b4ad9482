#include "core/effects/drying/drying.h"

#include "core/model/chance.h"

namespace adhesim {

DryingEffect::DryingEffect(const Model&, const v1::Drying& message)
    : gain_(message.gain()), time_constant_s_(message.time_constant_s()) {}

void DryingEffect::ScaleStrengths(double time_s, std::span<Bond> bonds) const {
  for (Bond& bond : bonds) {
    // 1 + (g - 1) (1 - wet), in the form that is 1 at first and g at last to the bit.
    const double wet = Exp(-bond.AgeAt(time_s) / time_constant_s_);
    bond.strength_scale *= wet + (1 - wet) * gain_;
  }
}

}  // namespace adhesim
