#pragma once

#include <array>
#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// Where a new effect begins: copy this folder (docs/effects.md). As it stands it is springs along
// the edges of surfaces, the least that has an energy of its own:
//   E = sum over edges of 1/2 k (|d| - L)^2,   f_i = k (|d| - L) d / |d| = -f_j,   d = x_j - x_i
// with L [m] the length at rest and k [N/m]. It resists stretch, and bending not at all.
//
// It is compiled and tested like any effect, but in no list. A message of its own would be in every
// scene's schema: it borrows that of shape_memory.
class TemplateEffect : public Effect {
 public:
  TemplateEffect(const Model& model, const v1::ShapeMemory& message);

  std::string_view name() const override { return "shape_memory"; }
  unsigned force_kinds() const override { return kElastic; }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddEnergies(std::span<double> energy_j) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;

 private:
  struct Edge {
    std::array<int, 2> ends;  // particles
    double length_m;          // at rest
  };
  double stiffness_n_m_;
  std::vector<Edge> edges_;
  mutable std::vector<double> edge_energy_j_;  // [#edges] of the last evaluation
};

}  // namespace adhesim
