#include "core/effects/shape_memory/cluster_batch.h"

#include <cstring>
#include <utility>

namespace adhesim {
namespace {

// GCC's vectors: one number a lane, whatever the machine's registers. They never cross a call
// (everything below is inlined), so that their ABI does not matter.
#pragma GCC diagnostic ignored "-Wpsabi"
#define ADHESIM_INLINE __attribute__((always_inline)) static inline

// The arithmetic on kWidth lanes of a batch at once, the first of them being `first`.
template <int kWidth>
struct Kernel {
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

  // Solves a symmetric 3x3 (a b c; b d e; c e f) x = g in every lane by the adjugate; lanes that
  // are not positive definite above `floor` give zero in `*good`.
  ADHESIM_INLINE void SolvePositive(const V& a, const V& b, const V& c, const V& d, const V& e,
                                    const V& f, const V3& g, const V& floor, V3* x, Mask* good) {
    const V aa = d * f - e * e, ab = c * e - b * f, ac = b * e - c * d;
    const V determinant = a * aa + b * ab + c * ac;
    const V minor = a * d - b * b;
    *good = (a > floor) & (minor > floor * a) & (determinant > floor * minor);
    const V bb = a * f - c * c, bc = b * c - a * e;
    const V zero = V{};
    const V scale = *good ? (zero + 1.0) / (*good ? determinant : zero + 1.0) : zero;
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

  // The iteration of core/model/polar.cc in every lane; a lane that has converged keeps its
  // rotation. Its Newton step d is applied as the unit quaternion (1 - p^2, 2 p) / (1 + p^2), p = d
  // / 4: no square root.
  ADHESIM_INLINE unsigned FindRotations(const V33& a, V q[4]) {
    const V zero = V{}, one = zero + 1.0;
    V size_sq = zero;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) size_sq += a.m[i][j] * a.m[i][j];
    }
    double size[kWidth];
    std::memcpy(size, &size_sq, sizeof(size));
    for (double& value : size) value = 1e-12 * __builtin_sqrt(value);
    V floor;
    std::memcpy(&floor, size, sizeof(floor));
    Mask active = zero == zero, failed = zero != zero;
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
      good &= step_sq < zero + 4.0;
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
      q[0] = active ? nx * unit : q[0];
      q[1] = active ? ny * unit : q[1];
      q[2] = active ? nz * unit : q[2];
      q[3] = active ? nw * unit : q[3];
      active &= step_sq >= zero + 1e-16;
      if (Bits(active) == 0) break;
    }
    return Bits(failed) | Bits(active);
  }

  // f_j = -c w_j (v_j - V - W x r_j) with (V, W) the cluster's own rigid motion: both momenta
  // conserved, rotation free.
  ADHESIM_INLINE void DampingForces(int first, const ClusterBatch& batch,
                                    std::span<const ClusterEntry> entries,
                                    std::span<const Vec3> velocity_m_s, double damping_n_s_m,
                                    const V3& mean, std::span<const Lanes3> offset,
                                    std::span<Lanes3> out) {
    const V zero = V{}, w = Load(batch.inverse_count, first);
    V3 velocity{zero, zero, zero}, spin{zero, zero, zero};
    V xx = zero, yy = zero, zz = zero, xy = zero, xz = zero, yz = zero;
    for (int m = 0; m < batch.members; ++m) {
      const V3 v = Gather(velocity_m_s, entries[m].particle + first);
      Store3(v, &out[m], first);
      const V present = w * Load(entries[m].present, first);
      velocity.x += present * v.x;
      velocity.y += present * v.y;
      velocity.z += present * v.z;
      V3 r = Load3(offset[m], first);
      r.x -= mean.x;
      r.y -= mean.y;
      r.z -= mean.z;
      xx += present * r.x * r.x;
      yy += present * r.y * r.y;
      zz += present * r.z * r.z;
      xy += present * r.x * r.y;
      xz += present * r.x * r.z;
      yz += present * r.y * r.z;
      spin.x += present * (r.y * v.z - r.z * v.y);
      spin.y += present * (r.z * v.x - r.x * v.z);
      spin.z += present * (r.x * v.y - r.y * v.x);
    }
    // A cluster on a line has no inertia about it, and no motion about it either: the floor stands
    // in for it.
    const V floor = 1e-12 * (xx + yy + zz);
    V3 omega;
    Mask good;
    SolvePositive(yy + zz + floor, -xy, -xz, xx + zz + floor, -yz, xx + yy + floor, spin, zero,
                  &omega, &good);
    for (int m = 0; m < batch.members; ++m) {
      const V3 v = Load3(out[m], first);
      V3 r = Load3(offset[m], first);
      r.x -= mean.x;
      r.y -= mean.y;
      r.z -= mean.z;
      const V scale = -damping_n_s_m * w * Load(entries[m].present, first);
      const V3 f{scale * (v.x - velocity.x - (omega.y * r.z - omega.z * r.y)),
                 scale * (v.y - velocity.y - (omega.z * r.x - omega.x * r.z)),
                 scale * (v.z - velocity.z - (omega.x * r.y - omega.y * r.x))};
      Store3(f, &out[m], first);
    }
  }

  ADHESIM_INLINE unsigned Evaluate(int first, const ClusterBatch& batch,
                                   std::span<const ClusterEntry> entries,
                                   std::span<const Vec3> position_m,
                                   std::span<const Vec3> velocity_m_s, double stiffness_n_m,
                                   double damping_n_s_m, Lanes rotation[4],
                                   const ClusterForces& out) {
    const V zero = V{};
    // Offsets from the cluster's own particle, so that no digits are lost far from the origin.
    // Those at rest sum to zero: A = sum (x_j - C) q_j^T needs no mean, and a common factor does
    // not change its rotation.
    const V3 origin = Gather(position_m, entries[0].particle + first);
    V3 sum{zero, zero, zero};
    V33 a;
    for (auto& row : a.m) {
      for (V& v : row) v = zero;
    }
    for (int m = 0; m < batch.members; ++m) {
      V3 r = Gather(position_m, entries[m].particle + first);
      r.x -= origin.x;
      r.y -= origin.y;
      r.z -= origin.z;
      Store3(r, &out.elastic_n[m], first);
      sum.x += r.x;
      sum.y += r.y;
      sum.z += r.z;
      const V3 q = Load3(entries[m].rest_offset_m, first);
      a.m[0][0] += r.x * q.x;
      a.m[0][1] += r.x * q.y;
      a.m[0][2] += r.x * q.z;
      a.m[1][0] += r.y * q.x;
      a.m[1][1] += r.y * q.y;
      a.m[1][2] += r.y * q.z;
      a.m[2][0] += r.z * q.x;
      a.m[2][1] += r.z * q.y;
      a.m[2][2] += r.z * q.z;
    }
    V q[4];
    for (int k = 0; k < 4; ++k) q[k] = Load(rotation[k], first);
    const unsigned failed = FindRotations(a, q);
    for (int k = 0; k < 4; ++k) Store(q[k], &rotation[k], first);
    V33 rot;
    RotationMatrix(q[0], q[1], q[2], q[3], &rot);

    const V w = Load(batch.inverse_count, first);
    const V3 mean{w * sum.x, w * sum.y, w * sum.z};
    if (!out.damping_n.empty()) {
      DampingForces(first, batch, entries, velocity_m_s, damping_n_s_m, mean, out.elastic_n,
                    out.damping_n);
    }
    // The offsets at rest sum to zero but for round-off, which would push the cluster the same way
    // in every step.
    const V3 stray = Load3(batch.rest_mean_m, first);
    const V3 centre{
        mean.x - (rot.m[0][0] * stray.x + rot.m[0][1] * stray.y + rot.m[0][2] * stray.z),
        mean.y - (rot.m[1][0] * stray.x + rot.m[1][1] * stray.y + rot.m[1][2] * stray.z),
        mean.z - (rot.m[2][0] * stray.x + rot.m[2][1] * stray.y + rot.m[2][2] * stray.z)};
    const V k = stiffness_n_m * w;
    V energy = zero;
    for (int m = 0; m < batch.members; ++m) {
      const V3 r = Load3(out.elastic_n[m], first), rest = Load3(entries[m].rest_offset_m, first);
      const V present = Load(entries[m].present, first);
      const V ex =
          r.x - centre.x - (rot.m[0][0] * rest.x + rot.m[0][1] * rest.y + rot.m[0][2] * rest.z);
      const V ey =
          r.y - centre.y - (rot.m[1][0] * rest.x + rot.m[1][1] * rest.y + rot.m[1][2] * rest.z);
      const V ez =
          r.z - centre.z - (rot.m[2][0] * rest.x + rot.m[2][1] * rest.y + rot.m[2][2] * rest.z);
      const V scale = -(k * present);
      Store3({scale * ex, scale * ey, scale * ez}, &out.elastic_n[m], first);
      energy += present * (ex * ex + ey * ey + ez * ez);
    }
    Store(0.5 * k * energy, out.energy_j, first);
    return failed << first;
  }
};

}  // namespace

unsigned EvaluateClusters(Simd simd, const ClusterBatch& batch,
                          std::span<const ClusterEntry> entries, std::span<const Vec3> position_m,
                          std::span<const Vec3> velocity_m_s, double stiffness_n_m,
                          double damping_n_s_m, Lanes rotation[4], const ClusterForces& out) {
  unsigned failed = 0;
  RunSimd(simd, [&](auto target) {
    constexpr int kWidth = decltype(target)::value == Simd::kAvx512 ? 8 : 4;
    for (int first = 0; first < kLanes; first += kWidth) {
      failed |= Kernel<kWidth>::Evaluate(first, batch, entries, position_m, velocity_m_s,
                                         stiffness_n_m, damping_n_s_m, rotation, out);
    }
  });
  return failed;
}

}  // namespace adhesim
