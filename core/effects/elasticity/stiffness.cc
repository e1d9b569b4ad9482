#include <algorithm>

#include "core/effects/elasticity/elasticity.h"

// The matrix: blocks of tetrahedra summed edge by edge, edges written into rows.
namespace adhesim {
namespace {

constexpr int kParticleGrain = 512;
constexpr int kEdgeGrain = 1024;

// GCC's vectors, as in core/model/lanes.h: they never cross a call.
#pragma GCC diagnostic ignored "-Wpsabi"
typedef double V4 __attribute__((vector_size(32)));

// A block's nine numbers, column by column.
struct Block {
  V4 first, second;
  double last;
};
ADHESIM_INLINE Block LoadBlock(const double* from) {
  Block block;
  std::memcpy(&block.first, from, sizeof(V4));
  std::memcpy(&block.second, from + 4, sizeof(V4));
  block.last = from[8];
  return block;
}
ADHESIM_INLINE void AddBlock(const Block& block, double* to) {
  const Block before = LoadBlock(to);
  const V4 first = before.first + block.first, second = before.second + block.second;
  std::memcpy(to, &first, sizeof(V4));
  std::memcpy(to + 4, &second, sizeof(V4));
  to[8] = before.last + block.last;
}
ADHESIM_INLINE Mat3 MatrixOf(const Block& block) {
  Mat3 matrix;
  std::memcpy(matrix.data(), &block.first, sizeof(V4));
  std::memcpy(matrix.data() + 4, &block.second, sizeof(V4));
  matrix.data()[8] = block.last;
  return matrix;
}
ADHESIM_INLINE Block Transposed(const Block& block) {
  return {__builtin_shufflevector(block.first, block.second, 0, 3, 6, 1),
          __builtin_shufflevector(block.first, block.second, 4, 7, 2, 5), block.last};
}

}  // namespace

void ElasticityEffect::AddPairs(BlockMatrix::Pattern* pattern) const {
  for (const Edge& edge : edge_) pattern->Add(edge.low, edge.high);
}

void ElasticityEffect::UseMatrix(const BlockMatrix& matrix) {
  edge_block_n_m_.resize(edge_.size());
  FindNeighbours();
  std::vector<std::vector<RowEntry>> rows(particle_.size());
  const auto row_of = [&](std::int32_t particle) -> std::vector<RowEntry>& {
    return rows[std::lower_bound(particle_.begin(), particle_.end(), particle) - particle_.begin()];
  };
  // Edges ascend by their lower end: a row gets its lower neighbours first, then the higher ones.
  for (std::int32_t e = 0; e < static_cast<std::int32_t>(edge_.size()); ++e) {
    const auto [low, high] = edge_[e];
    row_of(low).push_back({e, matrix.Slot(low, high), false});
    row_of(high).push_back({e, matrix.Slot(high, low), true});
  }
  row_start_.assign(1, 0);
  row_entry_.clear();
  diagonal_slot_.clear();
  for (std::size_t k = 0; k < rows.size(); ++k) {
    row_entry_.insert(row_entry_.end(), rows[k].begin(), rows[k].end());
    row_start_.push_back(static_cast<std::int32_t>(row_entry_.size()));
    diagonal_slot_.push_back(matrix.Slot(particle_[k], particle_[k]));
  }
}

// Batches that have an edge in common.
void ElasticityEffect::FindNeighbours() {
  std::vector<std::pair<std::int32_t, std::int32_t>> at_edge;  // (edge, batch)
  for (std::size_t b = 0; b < batch_.size(); ++b) {
    for (const auto& pair : batch_[b].edge) {
      for (const std::int32_t e : pair) at_edge.emplace_back(e, static_cast<std::int32_t>(b));
    }
  }
  const auto sort = [](auto* pairs) {
    std::sort(pairs->begin(), pairs->end());
    pairs->erase(std::unique(pairs->begin(), pairs->end()), pairs->end());
  };
  sort(&at_edge);
  std::vector<std::pair<std::int32_t, std::int32_t>> neighbours;
  for (std::size_t k = 0, end = 0; k < at_edge.size(); k = end) {
    while (end < at_edge.size() && at_edge[end].first == at_edge[k].first) ++end;
    for (std::size_t i = k; i < end; ++i) {
      for (std::size_t j = k; j < end; ++j) {
        neighbours.emplace_back(at_edge[i].second, at_edge[j].second);
      }
    }
  }
  sort(&neighbours);
  neighbour_start_.assign(batch_.size() + 1, 0);
  neighbour_.clear();
  for (const auto& [batch, other] : neighbours) {
    ++neighbour_start_[batch + 1];
    neighbour_.push_back(other);
  }
  for (std::size_t b = 0; b < batch_.size(); ++b) neighbour_start_[b + 1] += neighbour_start_[b];
  changed_.assign(batch_.size(), 0);
  batch_counts_.assign(batch_.size(), 0);
  edge_counts_.assign(edge_.size(), 0);
  summed_.assign(neo_hookean_ ? 0 : 4 * kLanes * batch_.size(), 0);
}

const double* ElasticityEffect::RotationsOf(int batch, const ForceInput& in) const {
  return &in.effect_state[(numbers_a_lane() * batch + (lags_ ? 4 : 0)) * kLanes];
}

// What has to be summed anew: edges of batches whose blocks are others than those in the sums. That
// depends on nothing but the rotations, so that a state which was restored gives the same sums.
void ElasticityEffect::FindChanges(const ForceInput& in, double stiffness_scale,
                                   double damping_scale) const {
  const bool by_rotation = !neo_hookean_ && (damping_s_ == 0 || damping_scale == 0);
  std::size_t changed = batch_.size();
  if (by_rotation) {
    constexpr std::size_t kBytes = 4 * kLanes * sizeof(double);
    changed = 0;
    for (std::size_t b = 0; b < batch_.size(); ++b) {
      const double* rotation = RotationsOf(static_cast<int>(b), in);
      double* summed = &summed_[4 * kLanes * b];
      // Bits, not values: zeros have a sign. NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
      changed_[b] = std::memcmp(summed, rotation, kBytes) != 0;
      if (!changed_[b]) continue;
      std::memcpy(summed, rotation, kBytes);
      ++changed;
    }
  }
  const bool all = !by_rotation || stiffness_scale != summed_scale_ || 4 * changed > batch_.size();
  summed_scale_ = by_rotation ? stiffness_scale : 0;
  std::fill(batch_counts_.begin(), batch_counts_.end(), all ? 1 : 0);
  std::fill(edge_counts_.begin(), edge_counts_.end(), all ? 1 : 0);
  if (all) return;
  for (std::size_t b = 0; b < batch_.size(); ++b) {
    if (!changed_[b]) continue;
    for (const auto& pair : batch_[b].edge) {
      for (const std::int32_t e : pair) edge_counts_[e] = 1;
    }
    for (int k = neighbour_start_[b]; k < neighbour_start_[b + 1]; ++k) {
      batch_counts_[neighbour_[k]] = 1;
    }
  }
}

void ElasticityEffect::AddStiffness(const ForceInput& in, double stiffness_scale,
                                    double damping_scale, BlockMatrix* matrix) const {
  FindChanges(in, stiffness_scale, damping_scale);
  in.parallel->VectorFor(static_cast<int>(edge_.size()), kEdgeGrain, [&](int begin, int end) {
    SumBlocks(in, stiffness_scale, damping_scale, begin, end);
  });
  in.parallel->VectorFor(static_cast<int>(particle_.size()), kParticleGrain,
                         [&](int begin, int end) { AddRows(begin, end, matrix); });
}

// Those of particle_[begin, end).
void ElasticityEffect::AddRows(int begin, int end, BlockMatrix* matrix) const {
  for (int k = begin; k < end; ++k) {
    Block diagonal{};  // minus the sum of the row's other blocks
    for (int r = row_start_[k]; r < row_start_[k + 1]; ++r) {
      Block block = LoadBlock(edge_block_n_m_[row_entry_[r].edge].data());
      if (row_entry_[r].transposed) block = Transposed(block);
      matrix->Add(row_entry_[r].slot, MatrixOf(block));
      diagonal.first -= block.first;
      diagonal.second -= block.second;
      diagonal.last -= block.last;
    }
    matrix->Add(diagonal_slot_[k], MatrixOf(diagonal));
  }
}

// Each thread evaluates every batch that has one of its edges: those of both neighbours are
// evaluated twice, and no sum depends on where the threads' shares end.
void ElasticityEffect::SumBlocks(const ForceInput& in, double stiffness_scale, double damping_scale,
                                 int begin, int end) const {
  for (int e = begin; e < end; ++e) {
    if (edge_counts_[e]) edge_block_n_m_[e].setZero();
  }
  TetBlocks blocks;
  for (int b = 0; b < static_cast<int>(batch_.size()); ++b) {
    const TetBatch& batch = batch_[b];
    if (!batch_counts_[b] || batch.end_edge <= begin || batch.first_edge >= end) continue;
    EvaluateBlocks(b, in, stiffness_scale, damping_scale, &blocks);
    for (int lane = 0; lane < LanesOf(b); ++lane) {
      for (int pair = 0; pair < 6; ++pair) {
        const std::int32_t e = batch.edge[pair][lane];
        if (e < begin || e >= end || !edge_counts_[e]) continue;
        AddBlock(LoadBlock(blocks.block[pair][lane]), edge_block_n_m_[e].data());
      }
    }
  }
}

void ElasticityEffect::EvaluateBlocks(int b, const ForceInput& in, double stiffness_scale,
                                      double damping_scale, TetBlocks* blocks) const {
  const TetBatch& batch = batch_[b];
  const Simd simd = in.parallel->simd();
  if (neo_hookean_) {
    NeoHookeanStiffness(simd, batch, in.position_m, stiffness_scale, blocks);
    const double* recovers = &in.effect_state[kLanes * b];
    for (int lane = 0; lane < LanesOf(b); ++lane) {
      if (recovers[lane] == 0) continue;
      SetRecoveryStiffness(batch, lane, in.position_m, stiffness_scale, blocks);
    }
  } else {
    TetRotations rotation;
    std::memcpy(static_cast<void*>(rotation), RotationsOf(b, in), sizeof(rotation));
    CorotationalStiffness(simd, batch, stiffness_scale, rotation, blocks);
  }
  if (damping_s_ > 0 && damping_scale != 0) {
    AddDampingStiffness(simd, batch, in.position_m, damping_scale * damping_s_, blocks);
  }
}

}  // namespace adhesim
