#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <vector>

#include "core/model/effect.h"
#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Energy of the bodies alone where effects are a method of contact and have a potential of their
// own (links, attraction impulses): who watches the bodies sees this, and what they borrow from
// such a potential looks as if it came from nowhere.
class BodiesEnergy {
 public:
  // Errors: those of MakeEffect.
  static absl::StatusOr<BodiesEnergy> Create(const Model& model);

  // Whether there is such a method; otherwise Engine::MechanicalEnergy() is the bodies' energy.
  bool contact_by_effects() const { return contact_by_effects_; }

  // Kinetic energy and the elastic energy of every effect that does not ask for near pairs, J.
  double Of(const State& state) const;

 private:
  struct Elasticity {
    std::unique_ptr<Effect> effect;
    int first;  // of its part of State::effect_state
  };

  int particles_ = 0;
  std::vector<Elasticity> elasticities_;
  bool contact_by_effects_ = false;
};

}  // namespace adhesim
