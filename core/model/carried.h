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

// [#particles] index into Model::carried, or -1; empty when nothing is carried.
inline std::vector<std::int32_t> CarriedIndex(const Model& model) {
  std::vector<std::int32_t> index;
  if (!model.carried.empty()) index.assign(model.rest_position_m.size(), -1);
  for (std::size_t c = 0; c < model.carried.size(); ++c) {
    index[model.carried[c].particle] = static_cast<std::int32_t>(c);
  }
  return index;
}

}  // namespace adhesim
