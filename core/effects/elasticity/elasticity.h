#pragma once

#include <vector>

#include "core/effects/elasticity/tet_batch.h"
#include "core/model/effect.h"

namespace adhesim {

// Elasticity and Kelvin-Voigt damping of bodies of tetrahedra (README.md). A tetrahedron with
// corners x_a has F = sum_a x_a b_a^T, an energy V psi(F), and forces f_a = -V P b_a, P = dpsi/dF.
// Eight tetrahedra a batch (tet_batch.h).
class ElasticityEffect : public Effect {
 public:
  ElasticityEffect(const Model& model, const v1::Elasticity& message);

  std::string_view name() const override { return "elasticity"; }
  bool lets_sleep() const override { return true; }
  unsigned force_kinds() const override { return kElastic | (damping_s_ > 0 ? kDamping : 0u); }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddEnergies(std::span<double> energy_j) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;
  bool has_stiffness() const override { return true; }
  void AddPairs(BlockMatrix::Pattern* pattern) const override;
  void UseMatrix(const BlockMatrix& matrix) override;
  void AddStiffness(const ForceInput& in, double stiffness_scale, double damping_scale,
                    BlockMatrix* matrix) const override;
  // Of the corotational law: the rotation of each lane, x, y, z, w, and where the stiffness lags
  // behind also that of its stiffness. Of the neo-Hookean law: 1 while the lane's tetrahedron
  // recovers (README.md), otherwise 0.
  int state_size() const override {
    return static_cast<int>(batch_.size()) * numbers_a_lane() * kLanes;
  }
  void InitialState(std::span<double> state) const override;

 private:
  struct Edge {
    std::int32_t low, high;  // particles
  };
  void MakeBatches(const Model& model, const v1::Elasticity& message,
                   std::span<const std::int32_t> tetrahedra);
  void FindEdges();
  void ListCorners();
  int LanesOf(int batch) const { return std::min(kLanes, tet_count_ - batch * kLanes); }
  void EvaluateBatch(int batch, const ForceInput& in, TetForces* forces) const;
  void SpreadRecovery(const ForceInput& in) const;
  void EvaluateNeoHookean(int batch, const ForceInput& in, TetForces* forces) const;
  void EvaluateCorotational(int batch, const ForceInput& in, TetForces* forces) const;
  int numbers_a_lane() const { return neo_hookean_ ? 1 : lags_ ? 8 : 4; }
  const double* RotationsOf(int batch, const ForceInput& in) const;  // of its stiffness
  void FindNeighbours();
  void FindChanges(const ForceInput& in, double stiffness_scale, double damping_scale) const;
  void EvaluateBlocks(int batch, const ForceInput& in, double stiffness_scale, double damping_scale,
                      TetBlocks* blocks) const;
  // Sums the blocks of tetrahedra at those of the edges [begin, end) that changed.
  void SumBlocks(const ForceInput& in, double stiffness_scale, double damping_scale, int begin,
                 int end) const;
  void AddRows(int begin, int end, BlockMatrix* matrix) const;

  double damping_s_;
  bool neo_hookean_;
  std::int32_t body_ = -1;  // the first of those that it acts on: they all sleep or none
  // Stiffness keeps its rotation until a tetrahedron of the batch has turned by kLag from it.
  bool lags_ = false;
  int tet_count_ = 0;
  std::vector<TetBatch> batch_;
  // Pairs of particles with a tetrahedron in common, ascending.
  std::vector<Edge> edge_;
  // Corners at a particle: those of particle_[k] are corner_[corner_start_[k] .. corner_start_[k +
  // 1]), ascending, as 4 * tetrahedron + corner. Each particle sums its own in this order, whatever
  // the threads.
  std::vector<std::int32_t> particle_;
  std::vector<std::int32_t> corner_start_;
  std::vector<std::int32_t> corner_;
  // Rows of the matrix, one for each of particle_: its edges ascending by the other end, and where
  // their blocks are.
  struct RowEntry {
    std::int32_t edge;
    std::int32_t slot;
    bool transposed;  // the row is that of the edge's higher end
  };
  std::vector<std::int32_t> row_start_;
  std::vector<RowEntry> row_entry_;
  std::vector<std::int32_t> diagonal_slot_;
  // Batches with an edge in common with batch b, itself too: neighbour_[neighbour_start_[b] ..).
  std::vector<std::int32_t> neighbour_start_, neighbour_;
  // Scratch of one evaluation; not part of the state.
  mutable std::vector<std::uint8_t>
      recovers_;                         // [#particles], neo-Hookean: of a tetrahedron that does
  mutable std::vector<Lanes> energy_j_;  // [#batches]
  mutable std::vector<Vec3> elastic_n_;  // [4 x #tetrahedra], for more than one thread
  mutable std::vector<Vec3> damping_n_;  // likewise, or empty
  // Sums over tetrahedra, and what they are of: they are summed anew where that has changed.
  mutable std::vector<Mat3> edge_block_n_m_;   // [#edges], block (low, high)
  mutable std::vector<double> summed_;         // [#batches x 4 x kLanes] rotations
  mutable double summed_scale_ = 0;            // 0: of more than rotations
  mutable std::vector<std::uint8_t> changed_;  // [#batches]
  mutable std::vector<std::uint8_t> batch_counts_, edge_counts_;  // [#batches], [#edges]
};

}  // namespace adhesim
