#include <algorithm>
#include <cmath>

#include "core/effects/elasticity/tet_batch.h"
#include "core/model/polar.h"

// The law of what recovers: corotational, but with a resistance to changes of volume that grows no
// further beyond a strain of about t_0:
//   psi = mu |D|^2 + lambda t_0^2 (sqrt(1 + (t / t_0)^2) - 1),  D = F - R, t = tr(R^T D),
//   P = 2 mu D + lambda t / sqrt(1 + (t / t_0)^2) R.
// With lambda/2 t^2 instead, 5 of 40 scrambled blocks stayed in a tangle; softened, 1 of 120.
namespace adhesim {
namespace {

constexpr double kSoftening = 0.1;  // t_0

struct Turned {
  Mat3 rotation, rest;    // R, D
  std::array<Vec3, 4> b;  // R b_a
  double trace, root;     // t, sqrt(1 + (t / t_0)^2)
};
Turned TurnedOf(const TetBatch& batch, int lane, std::span<const Vec3> position_m) {
  Turned turned;
  const Mat3 f = DeformationGradient(batch, lane, position_m);
  turned.rotation = PolarRotation(f, Quat::Identity()).toRotationMatrix();
  turned.rest = f - turned.rotation;
  turned.b = GradientsOf(batch, lane);
  for (Vec3& b : turned.b) b = turned.rotation * b;
  turned.trace = turned.rotation.cwiseProduct(turned.rest).sum();
  turned.root = std::sqrt(1 + turned.trace * turned.trace / (kSoftening * kSoftening));
  return turned;
}

}  // namespace

bool IsInsideOut(const TetBatch& batch, int lane, std::span<const Vec3> position_m) {
  return DeformationGradient(batch, lane, position_m).determinant() <= 0;
}

double StrainSq(const TetBatch& batch, int lane, std::span<const Vec3> position_m) {
  return TurnedOf(batch, lane, position_m).rest.squaredNorm();
}

// f_a = -P b_a.
double SetRecoveryForces(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                         TetForces* out) {
  const double shear_j = batch.shear_j.v[lane], lame_j = batch.lame_j.v[lane];
  const Turned at = TurnedOf(batch, lane, position_m);
  const double strain_sq = at.rest.squaredNorm();
  // t_0^2 (root - 1) = t^2 / (root + 1), which does not cancel.
  out->energy_j.v[lane] = shear_j * strain_sq + lame_j * at.trace * at.trace / (at.root + 1);
  const double pressure_j = lame_j * at.trace / at.root;
  const std::array<Vec3, 4> b = GradientsOf(batch, lane);
  for (int a = 0; a < 4; ++a) {
    const Vec3 force = -2 * shear_j * (at.rest * b[a]) - pressure_j * at.b[a];
    SetLane(force, lane, &out->elastic_n[a]);
  }
  return strain_sq;
}

// That of the corotational law, with the secant of the softened part: positive, and no less than
// its derivative.
void SetRecoveryStiffness(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                          double scale, TetBlocks* out) {
  const double shear_j = scale * batch.shear_j.v[lane], lame_j = scale * batch.lame_j.v[lane];
  const Turned at = TurnedOf(batch, lane, position_m);
  int pair = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = i + 1; j < 4; ++j, ++pair) {
      const Vec3 &bi = at.b[i], &bj = at.b[j];
      const Mat3 block = lame_j / at.root * bi * bj.transpose() +
                         shear_j * (bj * bi.transpose() + bi.dot(bj) * Mat3::Identity());
      std::copy_n(block.data(), 9, out->block[pair][lane]);
    }
  }
}

}  // namespace adhesim
