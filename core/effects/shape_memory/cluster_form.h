#pragma once

#include <vector>

#include "core/effects/shape_memory/cluster_batch.h"
#include "core/model/effect.h"

namespace adhesim {

// E_i = 1/2 k sum_j w_j |x_j - C_i - R_i q_j|^2 over a particle and its neighbours, C_i their mean,
// q_j their offsets at rest, R_i the best rotation, w_j = 1 / #cluster. R_i minimises E_i, so that
// f_j = -k w_j (...) is the exact gradient and both momenta are conserved. Eight clusters a batch
// (cluster_batch.h).
class ClusterForm : public Effect {
 public:
  ClusterForm(const Model& model, const v1::ShapeMemory& message);

  std::string_view name() const override { return "shape_memory"; }
  unsigned force_kinds() const override { return kElastic | (damping_n_s_m_ > 0 ? kDamping : 0u); }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddEnergies(std::span<double> energy_j) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;
  // R_i of each lane: x, y, z, w.
  int state_size() const override { return static_cast<int>(batch_.size()) * 4 * kLanes; }
  void InitialState(std::span<double> state) const override;

 private:
  // Some bodies' batches, and the particles that they exert forces on.
  struct Block {
    int first_batch, end_batch;
    int first_particle, end_particle;  // into particle_
    int body;                          // the last of them: where bodies may sleep, the only one
  };
  static constexpr int kSlotStride = 3 * kLanes;  // numbers of an entry's force
  // Makes a block of the clusters around these particles, and empties the list.
  void AddBlock(const Model& model, std::vector<int>* centres);
  void AddBatch(const Model& model, std::span<const int> particles);
  void CollectSlots(int first_entry);
  double AddForcesOfAwake(const ForceInput& in, const ForceOutput& out) const;
  // Adds to each particle_[begin..end) its forces of all clusters.
  void SumForces(const std::vector<Lanes3>& entries, int begin, int end,
                 std::span<Vec3> force_n) const;
  void EvaluateBatch(int batch, const ForceInput& in) const;
  // The best rotation of one lane without a guess, where Newton found none.
  void RestartRotation(int batch, int lane, std::span<const Vec3> position_m,
                       Lanes rotation[4]) const;

  double stiffness_n_m_;
  double damping_n_s_m_;
  std::vector<ClusterBatch> batch_;
  std::vector<ClusterEntry> entry_;  // batch by batch, member by member
  std::vector<Block> block_;
  // Where the forces on a particle are: slots slot_start_[k] .. slot_start_[k + 1) of particle_[k],
  // the first number of an entry's lane, ascending. Each particle sums its own in this order,
  // whatever the threads.
  std::vector<int> particle_;
  std::vector<int> slot_start_ = {0};
  std::vector<int> slot_;
  // Scratch of one evaluation; not part of the state.
  mutable std::vector<Lanes3> elastic_n_;  // [#entries]
  mutable std::vector<Lanes3> damping_n_;  // [#entries], empty without damping
  mutable std::vector<Lanes> energy_j_;    // [#batches]
};

}  // namespace adhesim
