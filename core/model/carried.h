#pragma once

#include <span>
#include <vector>

#include "core/model/model.h"

namespace adhesim {

// Carried particles have no motion of their own: what they are is a linear map of their carriers,
// x = sum of w_k x_k, and forces go back by its transpose.

// Positions, velocities or their changes [#particles]: writes those of carried particles.
inline void Carry(const Model& model, std::span<Vec3> value) {
  for (const CarriedParticle& c : model.carried) {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < 4; ++k) sum += c.weights[k] * value[c.carriers[k]];
    value[c.particle] = sum;
  }
}

// Forces, impulses or gradients [#particles]: moves those on carried particles to their carriers.
inline void GiveToCarriers(const Model& model, std::span<Vec3> force) {
  for (const CarriedParticle& c : model.carried) {
    for (int k = 0; k < 4; ++k) force[c.carriers[k]] += c.weights[k] * force[c.particle];
    force[c.particle].setZero();
  }
}

// What carries a particle. Points into the model, which must outlive it.
class CarriedLookup {
 public:
  explicit CarriedLookup(const Model& model) {
    if (!model.carried.empty()) carried_.assign(model.rest_position_m.size(), nullptr);
    for (const CarriedParticle& c : model.carried) carried_[c.particle] = &c;
  }
  // Nothing is carried.
  bool empty() const { return carried_.empty(); }
  // Null: the particle moves by itself.
  const CarriedParticle* Find(int particle) const {
    return carried_.empty() ? nullptr : carried_[particle];
  }

 private:
  std::vector<const CarriedParticle*> carried_;  // [#particles], or empty
};

}  // namespace adhesim
