#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/lanes.h"
#include "core/model/model.h"
#include "core/model/simd.h"

namespace adhesim {

// Clusters of about the same size. Lanes without a cluster repeat the first with weight zero,
// and so do the missing members of the smaller clusters.
struct ClusterBatch {
  int members = 0;      // of the largest
  int first_entry = 0;  // into the arrays of entries
  Lanes3 rest_mean_m;   // what is left of the sum of the offsets at rest, over #members: round-off
  Lanes inverse_count;  // 1 / #members, which is also the weight w_j
};

// A member of each of a batch's clusters.
struct ClusterEntry {
  std::int32_t particle[kLanes] = {};
  Lanes3 rest_offset_m;  // from the cluster's mean at rest
  Lanes present;         // 1, or 0 where the lane has no such member
};

// What a batch's clusters exert, entry by entry.
struct ClusterForces {
  std::span<Lanes3> elastic_n;  // [#members of the batch]
  std::span<Lanes3> damping_n;  // likewise, or empty
  Lanes* energy_j;
};

// Evaluates E = 1/2 k w sum |x_j - C - R q_j|^2 of every lane and its forces; `rotation` is R as
// quaternions x, y, z, w, the last one being the guess. Returns the lanes (bits) whose rotation
// Newton could not find: the caller finds it and calls again.
unsigned EvaluateClusters(Simd simd, const ClusterBatch& batch,
                          std::span<const ClusterEntry> entries, std::span<const Vec3> position_m,
                          std::span<const Vec3> velocity_m_s, double stiffness_n_m,
                          double damping_n_s_m, Lanes rotation[4], const ClusterForces& out);

}  // namespace adhesim
