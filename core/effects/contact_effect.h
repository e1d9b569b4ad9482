#pragma once

#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// What effects that act between a particle and a point of another body's surface share. The point
// has fixed weights w_k (barycentric coordinates) while forces act: a force f on the particle and
// -w_k f on the triangle's corners sum to nothing, and so do their torques, because f is along the
// line through both points.
class ContactEffect : public Effect {
 public:
  // Each pair's energy belongs to its particle.
  void AddEnergies(std::span<double> energy_j) const override;

 protected:
  explicit ContactEffect(const Model& model);

  // Empties the energies of the last evaluation.
  void BeginEvaluation() const;
  // The point's value of what `at` [#particles] says of the corners: its position, its velocity.
  Vec3 AtPoint(int triangle, const Vec3& weights, std::span<const Vec3> at) const;
  void AddPair(int particle, int triangle, const Vec3& weights, const Vec3& force_n,
               std::span<Vec3> force) const;
  // Adds the row sums of pairs of which each has the stiffness (or damping) `pair`: 2 of them times
  // 1 for a particle's own pair, and times the weights with which others touch its triangles, which
  // sum to about the ratio of the areas of both sides' particles. An estimate: bodies folded onto
  // one particle can exceed it.
  void AddPairBounds(double pair, std::span<double> row_sum) const;

  const Model& model_;
  mutable std::vector<double> energy_j_;  // [#particles] of the last evaluation
};

}  // namespace adhesim
