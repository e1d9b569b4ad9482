#pragma once

#include <cstdint>

#include "core/model/state.h"

namespace adhesim {

// A hash of all that a state's future depends on: positions, velocities, what effects keep, zones'
// momenta, bonds, tools. Bits count: -0 is not 0.
std::uint64_t HashState(const State& state);

}  // namespace adhesim
