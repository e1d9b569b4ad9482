#include "core/tools/rotation.h"

#include <cmath>

namespace adhesim {

Quat RotationOf(const Vec3& vector) {
  // Halve the angle until the series of sine and cosine are short, then square the quaternion as
  // often.
  Vec3 half = 0.5 * vector;
  int halvings = 0;
  while (half.squaredNorm() > 1.0 / 64 && halvings < 64) {
    half *= 0.5;
    ++halvings;
  }
  const double x = half.squaredNorm();  // angle^2, at most 1/64
  const double cosine = 1 - x / 2 * (1 - x / 12 * (1 - x / 30 * (1 - x / 56 * (1 - x / 90))));
  const double sine_over_angle =
      1 - x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110))));
  Quat q;
  q.w() = cosine;
  q.vec() = sine_over_angle * half;
  for (int i = 0; i < halvings; ++i) q = (q * q).normalized();
  return q.normalized();
}

Vec3 VectorOf(const Quat& rotation) {
  // q and -q are the same rotation; w >= 0 is the shorter way.
  Quat q = rotation.w() < 0 ? Quat(-rotation.coeffs()) : rotation;
  // The square root of a rotation is the bisector of itself and the identity.
  constexpr int kHalvings = 5;
  for (int i = 0; i < kHalvings; ++i) {
    q.w() += 1;
    q.normalize();
  }
  // Now the half angle is at most pi/64: atan(s)/s by its series.
  const double s_sq = q.vec().squaredNorm() / (q.w() * q.w());
  double series = 0;
  for (int n = 13; n >= 1; n -= 2) series = 1.0 / n - s_sq * series;
  return 2.0 * (1 << kHalvings) * series / q.w() * q.vec();
}

}  // namespace adhesim
