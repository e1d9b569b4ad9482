#include "core/effects/elasticity/tet_batch.h"
#include "core/model/polar.h"

namespace adhesim {
namespace {

struct Turned {
  Mat3 rotation, rest;    // R, F - R
  std::array<Vec3, 4> b;  // R b_a
};
Turned TurnedOf(const TetBatch& batch, int lane, std::span<const Vec3> position_m) {
  Turned turned;
  const Mat3 f = DeformationGradient(batch, lane, position_m);
  turned.rotation = PolarRotation(f, Quat::Identity()).toRotationMatrix();
  turned.rest = f - turned.rotation;
  turned.b = GradientsOf(batch, lane);
  for (Vec3& b : turned.b) b = turned.rotation * b;
  return turned;
}

}  // namespace

bool IsInsideOut(const TetBatch& batch, int lane, std::span<const Vec3> position_m) {
  return DeformationGradient(batch, lane, position_m).determinant() <= 0;
}

double StrainSq(const TetBatch& batch, int lane, std::span<const Vec3> position_m) {
  return TurnedOf(batch, lane, position_m).rest.squaredNorm();
}

// P = 2 mu D + lambda tr(R^T D) R, D = F - R; f_a = -P b_a.
double SetRecoveryForces(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                         TetForces* out) {
  const double shear_j = batch.shear_j.v[lane], lame_j = batch.lame_j.v[lane];
  const Turned at = TurnedOf(batch, lane, position_m);
  const double trace = at.rotation.cwiseProduct(at.rest).sum();
  const double strain_sq = at.rest.squaredNorm();
  out->energy_j.v[lane] = shear_j * strain_sq + 0.5 * lame_j * trace * trace;
  const std::array<Vec3, 4> b = GradientsOf(batch, lane);
  for (int a = 0; a < 4; ++a) {
    const Vec3 force = -2 * shear_j * (at.rest * b[a]) - lame_j * trace * at.b[a];
    SetLane(force, lane, &out->elastic_n[a]);
  }
  return strain_sq;
}

void SetRecoveryStiffness(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                          double scale, TetBlocks* out) {
  const double shear_j = scale * batch.shear_j.v[lane], lame_j = scale * batch.lame_j.v[lane];
  const Turned at = TurnedOf(batch, lane, position_m);
  int pair = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = i + 1; j < 4; ++j, ++pair) {
      const Vec3 &bi = at.b[i], &bj = at.b[j];
      const Mat3 block = lame_j * bi * bj.transpose() +
                         shear_j * (bj * bi.transpose() + bi.dot(bj) * Mat3::Identity());
      for (int k = 0; k < 9; ++k) out->entry[pair][k].v[lane] = block.data()[k];
    }
  }
}

}  // namespace adhesim
