#pragma once

#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// Active fibres between neighbouring particles i and j (ends of an edge of a tetrahedron, or of the
// surface), L apart (L_0 at rest), along d from i to j:
//   f_i = a(t) F_max l(L / L_0) d,  f_j = -f_i,  l(s) = max(0, 1 - 4 (s - 1)^2)
// with a the activation in [0, 1] and l the force-length relation of muscle, a parabola of half
// width 1/2 (Gordon, Huxley, Julian 1966; see README.md). Equal, opposite and collinear: the forces
// of a body sum to nothing, and so do their torques. What they do is work from outside (of the
// metabolism), not elastic energy: the passive elasticity is the body's own.
class MuscleEffect : public Effect {
 public:
  MuscleEffect(const Model& model, const v1::Muscle& message);

  std::string_view name() const override { return "muscle"; }
  unsigned force_kinds() const override { return kField; }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;

  // The activation at a time, between 0 and 1.
  double ActivationAt(double time_s) const;
  int fibre_count() const { return static_cast<int>(fibres_.size()); }

 private:
  struct Fibre {
    std::int32_t from, to;  // particles
    double rest_length_m;
  };
  struct Moment {
    double t_s, activation;
  };

  std::vector<Fibre> fibres_;
  std::vector<Moment> schedule_;  // by time
  double max_force_n_;
};

}  // namespace adhesim
