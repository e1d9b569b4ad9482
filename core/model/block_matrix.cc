#include "core/model/block_matrix.h"

#include <algorithm>

namespace adhesim {

BlockMatrix::BlockMatrix(int particles, Pattern pattern) {
  auto& pairs = pattern.pairs_;
  const std::size_t one_way = pairs.size();
  for (std::size_t k = 0; k < one_way; ++k) pairs.emplace_back(pairs[k].second, pairs[k].first);
  for (std::int32_t i = 0; i < particles; ++i) pairs.emplace_back(i, i);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  row_start_.assign(particles + 1, 0);
  column_.reserve(pairs.size());
  for (const auto& [i, j] : pairs) {
    ++row_start_[i + 1];
    column_.push_back(j);
  }
  for (int i = 0; i < particles; ++i) row_start_[i + 1] += row_start_[i];
  block_.assign(column_.size() + 1, Mat3::Zero());
}

std::int32_t BlockMatrix::Slot(std::int32_t i, std::int32_t j) const {
  const auto begin = column_.begin() + row_start_[i], end = column_.begin() + row_start_[i + 1];
  return static_cast<std::int32_t>(std::lower_bound(begin, end, j) - column_.begin());
}

void BlockMatrix::SetZero() { std::fill_n(block_[0].data(), 9 * block_.size(), 0.0); }

void BlockMatrix::Multiply(std::span<const Vec3> x, std::span<Vec3> y) const {
  for (int i = 0; i < particle_count(); ++i) {
    Vec3 sum = Vec3::Zero();
    for (std::int32_t k = row_start_[i]; k < row_start_[i + 1]; ++k)
      sum += block_[k] * x[column_[k]];
    y[i] = sum;
  }
}

}  // namespace adhesim
