#pragma once

#include <vector>

#include "core/model/effect.h"

namespace adhesim {

// E_i = 1/2 k |x_i - C_i - R_i q_i|^2 with the mean C_i and the best rotation R_i of the neighbours
// only: the paper's attractor (Carra et al. 2007, section 3.1; reconstructed, see README.md). The
// force is the exact gradient.
class CentreForm : public Effect {
 public:
  CentreForm(const Model& model, const v1::ShapeMemory& message);

  std::string_view name() const override { return "shape_memory"; }
  unsigned force_kinds() const override { return kElastic | (damping_n_s_m_ > 0 ? kDamping : 0u); }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddEnergies(std::span<double> energy_j) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override;
  int state_size() const override { return 4 * cluster_count(); }  // R_i as quaternions x, y, z, w
  void InitialState(std::span<double> state) const override;

 private:
  int cluster_count() const { return static_cast<int>(cluster_start_.size()) - 1; }
  void AddCluster(const Model& model, int particle);
  void EvaluateCluster(int cluster, const ForceInput& in) const;
  void AddForce(int cluster, const Mat3& rotation, const Vec3& mean, const ForceInput& in) const;
  void AddDampingForces(int cluster, const ForceInput& in) const;

  bool Sleeps(int cluster, const ForceInput& in) const {
    return in.Sleeps(model_.body_of[member_[cluster_start_[cluster]]]);
  }

  const Model& model_;
  double stiffness_n_m_;
  double damping_n_s_m_;
  // Clusters [#particles of the bodies]; members of cluster c are entries cluster_start_[c] ..
  // cluster_start_[c + 1). The cluster's own particle comes first.
  std::vector<int> cluster_start_;
  std::vector<int> member_;  // [#entries] particle
  std::vector<Vec3>
      rest_offset_;  // [#entries] m, from the mean at rest (of the neighbours, in the centre form)
  // Entries that act on a particle, ascending: each particle sums its own in this order, whatever
  // the threads.
  std::vector<int> particle_;     // [#particles of the bodies]
  std::vector<int> entry_start_;  // [#particles of the bodies + 1]
  std::vector<int> entry_;
  // Scratch of one evaluation; not part of the state.
  mutable std::vector<Vec3> entry_force_n_;    // [#entries]
  mutable std::vector<Vec3> entry_damping_n_;  // [#entries], empty without damping
  mutable std::vector<double> energy_j_;       // [#clusters]
};

}  // namespace adhesim
