#pragma once

#include "core/model/geometry.h"

namespace adhesim {

// Rotations as vectors (axis times angle, world axes). Written with + - * / sqrt alone, which IEEE
// rounds the same everywhere: sine and arc tangent of the C library differ between processors.
// Accurate to some 1e-14 rad.

// The rotation by |vector| radians about `vector`.
Quat RotationOf(const Vec3& vector);

// The shortest rotation vector of a unit quaternion, |result| <= pi.
Vec3 VectorOf(const Quat& rotation);

}  // namespace adhesim
