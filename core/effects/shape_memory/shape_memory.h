#pragma once

#include <memory>

#include "core/model/effect.h"

namespace adhesim {

// Local shape memory of a surface (README.md): the cluster form or the centre form, as the message
// says.
class ShapeMemoryEffect : public Effect {
 public:
  ShapeMemoryEffect(const Model& model, const v1::ShapeMemory& message);

  std::string_view name() const override { return "shape_memory"; }
  bool lets_sleep() const override { return true; }
  unsigned force_kinds() const override { return form_->force_kinds(); }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override {
    return form_->AddForces(in, out);
  }
  void AddEnergies(std::span<double> energy_j) const override { form_->AddEnergies(energy_j); }
  void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const override {
    form_->AddBounds(stiffness_n_m, damping_n_s_m);
  }
  int state_size() const override { return form_->state_size(); }
  void InitialState(std::span<double> state) const override { form_->InitialState(state); }

 private:
  std::unique_ptr<Effect> form_;
};

}  // namespace adhesim
