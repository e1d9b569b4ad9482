#include "core/effects/elasticity/tet_kernel.h"

namespace adhesim {

#pragma GCC diagnostic ignored "-Wpsabi"

// With D = F - R: psi = mu |D|^2 + lambda/2 (R : D)^2, since tr(R^T F - I) = R : D, and P = 2 mu D
// + lambda (R : D) R. The rotation's own change adds nothing: R^T F is symmetric.
unsigned CorotationalForces(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                            TetRotations rotation, TetForces* out) {
  unsigned failed = 0;
  ForLanes(
      simd, [&](auto width, int first) __attribute__((always_inline)) {
        using Kernel = TetKernel<decltype(width)::value>;
        using V = typename Kernel::V;
        using V33 = typename Kernel::V33;
        const V33 f = Kernel::Gradient(first, batch, position_m);
        V q[4];
        for (int k = 0; k < 4; ++k) q[k] = Kernel::Load(rotation[k], first);
        failed |= Kernel::FindRotations(f, q) << first;
        for (int k = 0; k < 4; ++k) Kernel::Store(q[k], &rotation[k], first);
        V33 r;
        Kernel::RotationMatrix(q[0], q[1], q[2], q[3], &r);
        V33 d;
        V size_sq{}, trace{};
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            d.m[i][j] = f.m[i][j] - r.m[i][j];
            size_sq += d.m[i][j] * d.m[i][j];
            trace += r.m[i][j] * d.m[i][j];
          }
        }
        const V shear = Kernel::Load(batch.shear_j, first),
                lame = Kernel::Load(batch.lame_j, first);
        Kernel::Store(shear * size_sq + 0.5 * lame * trace * trace, &out->energy_j, first);
        const V pressure = lame * trace;
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) d.m[i][j] = 2.0 * shear * d.m[i][j] + pressure * r.m[i][j];
        }
        Kernel::Exert(first, batch, d, out->elastic_n);
      });
  return failed;
}

// The linear stiffness in the rotated frame: with B_i = R b_i,
//   K_ij = V (lambda B_i B_j^T + mu (B_j B_i^T + (B_i . B_j) I)),
// which is R K0_ij R^T. It has the turning of R that goes with the strain, and leaves out the
// stiffness that stress itself has (of the order of the strain beside this one).
void CorotationalStiffness(Simd simd, const TetBatch& batch, double scale,
                           const TetRotations& rotation, TetBlocks* out) {
  ForLanes(
      simd, [&](auto width, int first) __attribute__((always_inline)) {
        using Kernel = TetKernel<decltype(width)::value>;
        using V = typename Kernel::V;
        V q[4];
        for (int k = 0; k < 4; ++k) q[k] = Kernel::Load(rotation[k], first);
        typename Kernel::V33 r;
        Kernel::RotationMatrix(q[0], q[1], q[2], q[3], &r);
        typename Kernel::V3 b[4];
        Kernel::TimesGradients(first, batch, r, b);
        const V shear = scale * Kernel::Load(batch.shear_j, first),
                lame = scale * Kernel::Load(batch.lame_j, first);
        int pair = 0;
        for (int i = 0; i < 3; ++i) {
          const V bi[3] = {b[i].x, b[i].y, b[i].z};
          for (int j = i + 1; j < 4; ++j, ++pair) {
            const V bj[3] = {b[j].x, b[j].y, b[j].z};
            const V along = shear * (bi[0] * bj[0] + bi[1] * bj[1] + bi[2] * bj[2]);
            const V lame_bi[3] = {lame * bi[0], lame * bi[1], lame * bi[2]},
                    shear_bi[3] = {shear * bi[0], shear * bi[1], shear * bi[2]};
            V entry[9];
            for (int c = 0; c < 3; ++c) {
              for (int k = 0; k < 3; ++k) {
                entry[3 * c + k] = lame_bi[k] * bj[c] + shear_bi[c] * bj[k];
                if (k == c) entry[3 * c + k] += along;
              }
            }
            Kernel::StoreBlocks(entry, first, out->block[pair]);
          }
        }
      });
}

}  // namespace adhesim
