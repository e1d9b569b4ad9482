#pragma once

#include "core/effects/elasticity/tet_batch.h"

namespace adhesim {

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"

// What all laws do with kWidth tetrahedra at once, the first of them being lane `first`.
template <int kWidth>
struct TetKernel : LaneMath<kWidth> {
  using Math = LaneMath<kWidth>;
  using typename Math::V;
  using typename Math::V3;
  using typename Math::V33;

  // sum_a (u_a - u_0) b_a^T: the gradient dx/dX of positions, its rate of velocities.
  ADHESIM_INLINE V33 Gradient(int first, const TetBatch& batch, std::span<const Vec3> of) {
    const V3 u0 = Math::Gather(of, batch.particle[0] + first);
    V33 f{};
    for (int a = 0; a < 3; ++a) {
      const V3 u = Math::Gather(of, batch.particle[a + 1] + first);
      const V3 b = Math::Load3(batch.gradient_1_m[a], first);
      const V du[3] = {u.x - u0.x, u.y - u0.y, u.z - u0.z};
      for (int i = 0; i < 3; ++i) {
        f.m[i][0] += du[i] * b.x;
        f.m[i][1] += du[i] * b.y;
        f.m[i][2] += du[i] * b.z;
      }
    }
    return f;
  }

  ADHESIM_INLINE V3 Times(const V33& m, const V3& u) {
    return {m.m[0][0] * u.x + m.m[0][1] * u.y + m.m[0][2] * u.z,
            m.m[1][0] * u.x + m.m[1][1] * u.y + m.m[1][2] * u.z,
            m.m[2][0] * u.x + m.m[2][1] * u.y + m.m[2][2] * u.z};
  }
  ADHESIM_INLINE V Dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

  // m b_a of all corners; that of the first is minus the sum of the others.
  ADHESIM_INLINE void TimesGradients(int first, const TetBatch& batch, const V33& m, V3 out[4]) {
    for (int a = 0; a < 3; ++a) {
      out[a + 1] = Times(m, Math::Load3(batch.gradient_1_m[a], first));
    }
    out[0] = {-(out[1].x + out[2].x + out[3].x), -(out[1].y + out[2].y + out[3].y),
              -(out[1].z + out[2].z + out[3].z)};
  }

  // f_a = -V P b_a of a first Piola stress P, given as V P.
  ADHESIM_INLINE void Exert(int first, const TetBatch& batch, const V33& stress_j, Lanes3 out[4]) {
    V3 force[4];
    TimesGradients(first, batch, stress_j, force);
    for (int a = 0; a < 4; ++a) {
      Math::Store3({-force[a].x, -force[a].y, -force[a].z}, &out[a], first);
    }
  }

  // One step of transposing: what two vectors have in each other's place.
  template <int kHalf, int... kLane>
  ADHESIM_INLINE void Exchange(V* a, V* b, std::integer_sequence<int, kLane...>) {
    const V low =
        __builtin_shufflevector(*a, *b, (kLane & kHalf ? kWidth + kLane - kHalf : kLane)...);
    *b = __builtin_shufflevector(*a, *b, (kLane & kHalf ? kWidth + kLane : kLane + kHalf)...);
    *a = low;
  }
  template <int kHalf>
  ADHESIM_INLINE void Transpose(V* row) {
    for (int i = 0; i < kWidth; ++i) {
      if (i & kHalf) continue;
      Exchange<kHalf>(row + i, row + i + kHalf, std::make_integer_sequence<int, kWidth>());
    }
    if constexpr (kHalf > 1) Transpose<kHalf / 2>(row);
  }
  // The nine entries of a block in every lane, as one block a lane: written, or added.
  template <bool kAdd = false>
  ADHESIM_INLINE void StoreBlocks(V entry[9], int first, double (*block)[9]) {
    for (int k = 0; k < 8; k += kWidth) {
      Transpose<kWidth / 2>(entry + k);
      for (int lane = 0; lane < kWidth; ++lane) {
        double* to = block[first + lane] + k;
        V v = entry[k + lane];
        if constexpr (kAdd) {
          V before;
          std::memcpy(&before, to, sizeof(V));
          v = before + v;
        }
        std::memcpy(to, &v, sizeof(V));
      }
    }
    double last[kWidth];
    std::memcpy(last, &entry[8], sizeof(V));
    for (int lane = 0; lane < kWidth; ++lane) {
      double* to = block[first + lane] + 8;
      *to = kAdd ? *to + last[lane] : last[lane];
    }
  }
};

// Calls loop(width, first) for the lanes of a batch, width::value of them at a time. Loops are
// marked always_inline, or they would not be compiled for the instruction set.
template <typename Loop>
ADHESIM_INLINE void ForLanes(Simd simd, const Loop& loop) {
  RunSimd(
      simd, [&](auto target) __attribute__((always_inline)) {
        constexpr int kWidth = decltype(target)::value == Simd::kAvx512 ? 8 : 4;
        for (int first = 0; first < kLanes; first += kWidth) {
          loop(std::integral_constant<int, kWidth>(), first);
        }
      });
}
#pragma GCC diagnostic pop

}  // namespace adhesim
