#include "core/effects/elasticity/tet_batch.h"

namespace adhesim {

std::array<Vec3, 4> GradientsOf(const TetBatch& batch, int lane) {
  std::array<Vec3, 4> b;
  for (int a = 0; a < 3; ++a) b[a + 1] = LaneOf(batch.gradient_1_m[a], lane);
  b[0] = -(b[1] + b[2] + b[3]);
  return b;
}

Mat3 DeformationGradient(const TetBatch& batch, int lane, std::span<const Vec3> position_m) {
  const Vec3& origin = position_m[batch.particle[0][lane]];
  Mat3 f = Mat3::Zero();
  for (int a = 0; a < 3; ++a) {
    f += (position_m[batch.particle[a + 1][lane]] - origin) *
         LaneOf(batch.gradient_1_m[a], lane).transpose();
  }
  return f;
}

}  // namespace adhesim
