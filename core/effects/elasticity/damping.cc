#include "core/effects/elasticity/tet_kernel.h"

namespace adhesim {

#pragma GCC diagnostic ignored "-Wpsabi"

// S = b (lambda tr(E') I + 2 mu E'), E' = sym(F^T F'), P = F S. The stress P F^T = F S F^T is
// symmetric, so that torques sum to nothing; the power is -V S : E' <= 0.
void DampingForces(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                   std::span<const Vec3> velocity_m_s, double damping_s, TetForces* out) {
  ForLanes(
      simd, [&](auto width, int first) __attribute__((always_inline)) {
        using Kernel = TetKernel<decltype(width)::value>;
        using V = typename Kernel::V;
        using V33 = typename Kernel::V33;
        const V33 f = Kernel::Gradient(first, batch, position_m);
        const V33 rate = Kernel::Gradient(first, batch, velocity_m_s);
        V33 w;  // F^T F'
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            w.m[i][j] =
                f.m[0][i] * rate.m[0][j] + f.m[1][i] * rate.m[1][j] + f.m[2][i] * rate.m[2][j];
          }
        }
        const V shear = damping_s * Kernel::Load(batch.shear_j, first);
        const V pressure =
            damping_s * Kernel::Load(batch.lame_j, first) * (w.m[0][0] + w.m[1][1] + w.m[2][2]);
        V33 s;
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            s.m[i][j] = shear * (w.m[i][j] + w.m[j][i]);
            if (i == j) s.m[i][j] += pressure;
          }
        }
        V33 p;
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            p.m[i][j] = f.m[i][0] * s.m[0][j] + f.m[i][1] * s.m[1][j] + f.m[i][2] * s.m[2][j];
          }
        }
        Kernel::Exert(first, batch, p, out->damping_n);
      });
}

// With W_i = F b_i: D_ij = V b (lambda W_i W_j^T + mu (W_j W_i^T + (b_i . b_j) F F^T)).
void AddDampingStiffness(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                         double scale, TetBlocks* out) {
  ForLanes(
      simd, [&](auto width, int first) __attribute__((always_inline)) {
        using Kernel = TetKernel<decltype(width)::value>;
        using V = typename Kernel::V;
        const auto f = Kernel::Gradient(first, batch, position_m);
        V left[3][3];  // F F^T
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            left[i][j] = f.m[i][0] * f.m[j][0] + f.m[i][1] * f.m[j][1] + f.m[i][2] * f.m[j][2];
          }
        }
        typename Kernel::V33 one{};
        for (int i = 0; i < 3; ++i) one.m[i][i] += 1.0;
        typename Kernel::V3 b[4], w[4];
        Kernel::TimesGradients(first, batch, one, b);
        Kernel::TimesGradients(first, batch, f, w);
        const V shear = scale * Kernel::Load(batch.shear_j, first),
                lame = scale * Kernel::Load(batch.lame_j, first);
        int pair = 0;
        for (int i = 0; i < 3; ++i) {
          const V wi[3] = {w[i].x, w[i].y, w[i].z};
          for (int j = i + 1; j < 4; ++j, ++pair) {
            const V wj[3] = {w[j].x, w[j].y, w[j].z};
            const V along = shear * Kernel::Dot(b[i], b[j]);
            V entry[9];
            for (int c = 0; c < 3; ++c) {
              for (int k = 0; k < 3; ++k) {
                entry[3 * c + k] =
                    lame * wi[k] * wj[c] + shear * wj[k] * wi[c] + along * left[k][c];
              }
            }
            Kernel::template StoreBlocks<true>(entry, first, out->block[pair]);
          }
        }
      });
}

}  // namespace adhesim
