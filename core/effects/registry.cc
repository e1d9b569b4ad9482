#include "core/effects/registry.h"

#include <absl/strings/str_cat.h>

#include "core/model/effect_name.h"

// The build writes effects_compiled.def: the lines of effects.def that are in ADHESIM_EFFECTS, and
// the includes.
#include "effects_compiled.h"

namespace adhesim {

absl::StatusOr<std::unique_ptr<Effect>> MakeEffect(const Model& model, const v1::Effect& message) {
#define ADHESIM_EFFECT(name, type) \
  if (message.has_##name()) return std::make_unique<type>(model, message.name());
#include "effects_compiled.def"
#undef ADHESIM_EFFECT
  return absl::UnimplementedError(absl::StrCat("effect '", EffectName(message),
                                               "' is not part of this build (ADHESIM_EFFECTS)"));
}

std::vector<std::string_view> AvailableEffects() {
  return {
#define ADHESIM_EFFECT(name, type) #name,
#include "effects_compiled.def"
#undef ADHESIM_EFFECT
  };
}

}  // namespace adhesim
