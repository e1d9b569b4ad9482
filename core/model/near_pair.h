#pragma once

#include <cstdint>

#include "core/model/geometry.h"

namespace adhesim {

// A particle near the surface of another body; with self-collision, near its own elsewhere.
struct NearPair {
  std::int32_t particle;
  std::int32_t body;      // whose surface it is
  std::int32_t triangle;  // its nearest triangle (the lowest number, if several are as near)
  Vec3 weights;           // barycentric coordinates of the nearest point
  Vec3 normal;            // unit, from the surface to the side the particle belongs on
  double gap_m;           // along `normal`: negative inside a closed body
  std::int8_t side;       // +1 when `normal` is on the triangle's outer side
};

}  // namespace adhesim
