#pragma once

#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <utility>

#include "core/model/geometry.h"

namespace adhesim {

// Elements side by side, one a SIMD lane: as many as the registers hold run through the same
// arithmetic at once (eight with AVX-512, four with AVX2, whose sixteen registers eight would
// spill, three times slower). There are no sums across lanes and no fused multiply-adds, so that
// every instruction set gives the same bits.
inline constexpr int kLanes = 8;

// One number a lane.
struct alignas(sizeof(double) * kLanes) Lanes {
  double v[kLanes] = {};
};
struct Lanes3 {
  Lanes x, y, z;
};

// GCC's vectors: one number a lane, whatever the machine's registers. They never cross a call
// (everything below is inlined), so that their ABI does not matter.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"
#define ADHESIM_INLINE __attribute__((always_inline)) static inline

// The arithmetic on kWidth lanes at once, the first of them being `first`.
template <int kWidth>
struct LaneMath {
  static_assert(kLanes % kWidth == 0);
  typedef double V __attribute__((vector_size(sizeof(double) * kWidth)));
  typedef std::int64_t Mask __attribute__((vector_size(sizeof(double) * kWidth)));

  ADHESIM_INLINE V Load(const Lanes& lanes, int first) {
    V v;
    std::memcpy(&v, lanes.v + first, sizeof(v));
    return v;
  }
  ADHESIM_INLINE void Store(const V& v, Lanes* lanes, int first) {
    std::memcpy(lanes->v + first, &v, sizeof(v));
  }

  struct V3 {
    V x, y, z;
  };
  ADHESIM_INLINE V3 Load3(const Lanes3& lanes, int first) {
    return {Load(lanes.x, first), Load(lanes.y, first), Load(lanes.z, first)};
  }
  ADHESIM_INLINE void Store3(const V3& v, Lanes3* lanes, int first) {
    Store(v.x, &lanes->x, first);
    Store(v.y, &lanes->y, first);
    Store(v.z, &lanes->z, first);
  }
  template <int... kLane>
  ADHESIM_INLINE V3 GatherLanes(std::span<const Vec3> from, const std::int32_t* index,
                                std::integer_sequence<int, kLane...>) {
    return {V{from[index[kLane]].x()...}, V{from[index[kLane]].y()...},
            V{from[index[kLane]].z()...}};
  }
  ADHESIM_INLINE V3 Gather(std::span<const Vec3> from, const std::int32_t* index) {
    return GatherLanes(from, index, std::make_integer_sequence<int, kWidth>());
  }

  struct V33 {
    V m[3][3];
  };

  ADHESIM_INLINE void RotationMatrix(const V& x, const V& y, const V& z, const V& w, V33* r) {
    const V one = V{} + 1.0;
    r->m[0][0] = one - 2.0 * (y * y + z * z);
    r->m[0][1] = 2.0 * (x * y - w * z);
    r->m[0][2] = 2.0 * (x * z + w * y);
    r->m[1][0] = 2.0 * (x * y + w * z);
    r->m[1][1] = one - 2.0 * (x * x + z * z);
    r->m[1][2] = 2.0 * (y * z - w * x);
    r->m[2][0] = 2.0 * (x * z - w * y);
    r->m[2][1] = 2.0 * (y * z + w * x);
    r->m[2][2] = one - 2.0 * (x * x + y * y);
  }

  // By the sign of the difference, and bits: g++ 12 compiles comparisons and selections of eight
  // lanes one by one. Not for numbers that are not finite.
  ADHESIM_INLINE Mask Less(const V& a, const V& b) { return reinterpret_cast<Mask>(a - b) >> 63; }
  ADHESIM_INLINE V Select(const Mask& where, const V& yes, const V& no) {
    return reinterpret_cast<V>((reinterpret_cast<Mask>(yes) & where) |
                               (reinterpret_cast<Mask>(no) & ~where));
  }
  ADHESIM_INLINE V Abs(const V& v) {
    return reinterpret_cast<V>(reinterpret_cast<Mask>(v) &
                               std::numeric_limits<std::int64_t>::max());
  }

  // Solves a symmetric 3x3 (a b c; b d e; c e f) x = g in every lane by the adjugate; lanes that
  // are not positive definite above `floor` give zero in `*good`.
  ADHESIM_INLINE void SolvePositive(const V& a, const V& b, const V& c, const V& d, const V& e,
                                    const V& f, const V3& g, const V& floor, V3* x, Mask* good) {
    const V aa = d * f - e * e, ab = c * e - b * f, ac = b * e - c * d;
    const V determinant = a * aa + b * ab + c * ac;
    const V minor = a * d - b * b;
    *good = Less(floor, a) & Less(floor * a, minor) & Less(floor * minor, determinant);
    const V bb = a * f - c * c, bc = b * c - a * e;
    const V one = V{} + 1.0;
    const V scale = Select(*good, one / Select(*good, determinant, one), V{});
    x->x = scale * (aa * g.x + ab * g.y + ac * g.z);
    x->y = scale * (ab * g.x + bb * g.y + bc * g.z);
    x->z = scale * (ac * g.x + bc * g.y + minor * g.z);
  }

  // Through memory: a vector's lane by a variable index is compiled wrongly by g++ 12.2 with -O1
  // -fsanitize=undefined (it reads a random index).
  ADHESIM_INLINE unsigned Bits(const Mask& mask) {
    std::int64_t lane[kWidth];
    std::memcpy(lane, &mask, sizeof(lane));
    unsigned bits = 0;
    for (int l = 0; l < kWidth; ++l) bits |= (lane[l] != 0 ? 1u : 0u) << l;
    return bits;
  }

  // The rotation nearest to `a`: the iteration of core/model/polar.cc in every lane, from the guess
  // in `q` (x, y, z, w); a lane that has converged keeps its rotation. Its Newton step d is applied
  // as the unit quaternion (1 - p^2, 2 p) / (1 + p^2), p = d / 4: no square root. Returns the lanes
  // (bits) where it failed.
  ADHESIM_INLINE unsigned FindRotations(const V33& a, V q[4]) {
    const V zero = V{}, one = zero + 1.0;
    V floor = zero;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) floor += 1e-12 * Abs(a.m[i][j]);
    }
    Mask active = ~Mask{}, failed{};
    for (int iteration = 0; iteration < 16; ++iteration) {
      V33 r;
      RotationMatrix(q[0], q[1], q[2], q[3], &r);
      V s[3][3];  // R^T A
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j)
          s[i][j] = r.m[0][i] * a.m[0][j] + r.m[1][i] * a.m[1][j] + r.m[2][i] * a.m[2][j];
      }
      const V3 axial{s[2][1] - s[1][2], s[0][2] - s[2][0], s[1][0] - s[0][1]};
      V3 d;
      Mask good;
      SolvePositive(s[1][1] + s[2][2], -0.5 * (s[1][0] + s[0][1]), -0.5 * (s[2][0] + s[0][2]),
                    s[0][0] + s[2][2], -0.5 * (s[2][1] + s[1][2]), s[0][0] + s[1][1], axial, floor,
                    &d, &good);
      const V step_sq = d.x * d.x + d.y * d.y + d.z * d.z;
      good &= Less(step_sq, zero + 4.0);
      failed |= active & ~good;
      active &= good;
      const V px = 0.25 * d.x, py = 0.25 * d.y, pz = 0.25 * d.z;
      const V p_sq = px * px + py * py + pz * pz;
      const V scale = one / (one + p_sq);
      const V dx = 2.0 * px * scale, dy = 2.0 * py * scale, dz = 2.0 * pz * scale,
              dw = (one - p_sq) * scale;
      const V nx = q[3] * dx + q[0] * dw + q[1] * dz - q[2] * dy;
      const V ny = q[3] * dy - q[0] * dz + q[1] * dw + q[2] * dx;
      const V nz = q[3] * dz + q[0] * dy - q[1] * dx + q[2] * dw;
      const V nw = q[3] * dw - q[0] * dx - q[1] * dy - q[2] * dz;
      // Takes back the round-off of the norm.
      const V unit = zero + 1.5 - 0.5 * (nx * nx + ny * ny + nz * nz + nw * nw);
      q[0] = Select(active, nx * unit, q[0]);
      q[1] = Select(active, ny * unit, q[1]);
      q[2] = Select(active, nz * unit, q[2]);
      q[3] = Select(active, nw * unit, q[3]);
      active &= ~Less(step_sq, zero + 1e-16);
      if (Bits(active) == 0) break;
    }
    return Bits(failed) | Bits(active);
  }
};
#pragma GCC diagnostic pop

}  // namespace adhesim
