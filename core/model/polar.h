#pragma once

#include "core/model/geometry.h"

namespace adhesim {

// The rotation R nearest to A: the maximiser of trace(R^T A) over rotations (the polar rotation
// where det A > 0). `start` is a guess; a near one makes this a few multiplications. Uses +, -, *,
// / and square roots only, so that the same input gives the same bits everywhere. Rank 2 (a flat
// cluster) is fine; of a rank-1 A the spin about its axis is that of the guess.
Quat PolarRotation(const Mat3& a, const Quat& start);

}  // namespace adhesim
