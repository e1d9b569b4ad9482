#pragma once

#include "core/effects/contact_effect.h"

namespace adhesim {

// Springs that appear where particles come close to another body and vanish when they are stretched
// too far (README.md). A link joins a particle p to a fixed point q of a triangle:
//
//   U = 1/2 k (|x_p - x_q| - d0)^2,   f = -k (|x_p - x_q| - d0) (x_p - x_q) / |x_p - x_q|
//
// Its energy at creation comes from nowhere, and that at removal goes nowhere: the ledger books
// both as numerical.
class ElasticLinksEffect : public ContactEffect {
 public:
  ElasticLinksEffect(const Model& model, const v1::ElasticLinks& message);

  std::string_view name() const override { return "elastic_links"; }
  unsigned force_kinds() const override { return kElastic; }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override;
  void AddBounds(std::span<double> stiffness_n_m, std::span<double>) const override {
    AddPairBounds(stiffness_n_m_, stiffness_n_m);
  }
  double contact_reach_m() const override { return capture_distance_m_; }
  // At most one link a particle: its triangle, or -1, and the weights of q.
  int state_size() const override { return kNumbers * model_.particle_count(); }
  void InitialState(std::span<double> state) const override;

 private:
  static constexpr int kNumbers = 4;
  void Remove(const ForceInput& in) const;
  void Create(const ForceInput& in) const;

  double capture_distance_m_;
  double rest_length_m_;
  double max_length_m_;
  double stiffness_n_m_;
};

}  // namespace adhesim
