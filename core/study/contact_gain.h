#pragma once

#include <algorithm>

#include "core/model/state.h"

namespace adhesim {

// What contact gained from one step to the next where it may only lose, J: less captured_j than
// before (an orthogonal projection takes energy, physics notes 3.2), rotation of zones.
inline double AdhesiveGain(const Ledger& before, const Ledger& after) {
  return std::max(0.0, before.captured_j - after.captured_j) +
         std::max(0.0, after.rotation_j - before.rotation_j);
}

// Likewise work of sliding contacts above 0.
inline double SlidingGain(const Ledger& before, const Ledger& after) {
  return std::max(0.0, after.sliding_j - before.sliding_j);
}

}  // namespace adhesim
