#include "core/effects/shape_memory/cluster_batch.h"

namespace adhesim {
namespace {

#pragma GCC diagnostic ignored "-Wpsabi"

// The arithmetic on kWidth lanes of a batch at once, the first of them being `first`.
template <int kWidth>
struct Kernel : LaneMath<kWidth> {
  using Math = LaneMath<kWidth>;
  using Math::FindRotations;
  using Math::Gather;
  using Math::Load;
  using Math::Load3;
  using Math::RotationMatrix;
  using Math::SolvePositive;
  using Math::Store;
  using Math::Store3;
  using typename Math::Mask;
  using typename Math::V;
  using typename Math::V3;
  using typename Math::V33;

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
