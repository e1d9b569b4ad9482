#pragma once

#include <string>

#include "adhesim/v1/scene.pb.h"

namespace adhesim {

// The name of an effect: that of the field which is set ("shape_memory"); empty when none is.
inline std::string EffectName(const v1::Effect& effect) {
  const auto* kind = v1::Effect::descriptor()->FindOneofByName("kind");
  const auto* field = effect.GetReflection()->GetOneofFieldDescriptor(effect, kind);
  return field == nullptr ? "" : field->name();
}

}  // namespace adhesim
