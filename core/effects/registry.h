#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string_view>
#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// The effect that a scene's message asks for. Errors: Unimplemented when it was left out of this
// build.
absl::StatusOr<std::unique_ptr<Effect>> MakeEffect(const Model& model, const v1::Effect& message);

// Names of the effects of this build, in the order of effects.def.
std::vector<std::string_view> AvailableEffects();

// Indices of the bodies that a message's `bodies` list selects; empty list: every body that
// `accepts`.
template <typename Names, typename Accepts>
std::vector<int> SelectBodies(const Model& model, const Names& names, const Accepts& accepts) {
  std::vector<int> selected;
  for (int b = 0; b < static_cast<int>(model.bodies.size()); ++b) {
    bool named = false;
    for (const auto& name : names) named = named || name == model.bodies[b].scene_name;
    if (named || (names.empty() && accepts(model.bodies[b]))) selected.push_back(b);
  }
  return selected;
}

}  // namespace adhesim
