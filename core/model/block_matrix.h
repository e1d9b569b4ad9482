#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// A symmetric sparse matrix of 3 x 3 blocks, [#particles x #particles]. The pattern is fixed at
// construction; the diagonal always exists. Blocks lie row by row, nine numbers each, columns of a
// block first: an author who sums over the tetrahedra at an edge writes each of its two blocks
// once.
class BlockMatrix {
 public:
  // The pairs (i, j), i != j, whose blocks can differ from zero; any order, repeats permitted.
  class Pattern {
   public:
    void Add(std::int32_t i, std::int32_t j) { pairs_.emplace_back(i, j); }

   private:
    friend class BlockMatrix;
    std::vector<std::pair<std::int32_t, std::int32_t>> pairs_;
  };

  BlockMatrix() = default;
  BlockMatrix(int particles, Pattern pattern);

  int particle_count() const { return static_cast<int>(row_start_.size()) - 1; }
  // Where block (i, j) is kept; the pattern must have it.
  std::int32_t Slot(std::int32_t i, std::int32_t j) const;
  void SetZero();
  // Block (i, j) alone: whoever adds to it adds the transpose to Slot(j, i).
  void Add(std::int32_t slot, const Mat3& block) { block_[slot] += block; }
  const Mat3& At(std::int32_t slot) const { return block_[slot]; }
  // y = A x, [#particles]. Plain: steps multiply by the rows below.
  void Multiply(std::span<const Vec3> x, std::span<Vec3> y) const;

  // Row i has the blocks [row_start()[i], row_start()[i + 1]), in the columns column()[...].
  std::span<const std::int32_t> row_start() const { return row_start_; }
  std::span<const std::int32_t> column() const { return column_; }
  // Nine numbers a block, and room to read one block more.
  const double* values() const { return block_[0].data(); }

 private:
  std::vector<std::int32_t> row_start_ = {0};  // [#particles + 1] into the arrays below
  std::vector<std::int32_t> column_;           // ascending within a row
  std::vector<Mat3> block_;                    // and one more, zero
};

}  // namespace adhesim
