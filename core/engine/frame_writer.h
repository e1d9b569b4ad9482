#pragma once

#include <memory>
#include <span>
#include <vector>

#include "core/engine/contact_frames.h"
#include "core/model/effect.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/state.h"
#include "core/solve/force_error.h"

namespace adhesim {

// Makes frames of states.
class FrameWriter {
 public:
  // Both outlive the writer.
  FrameWriter(const Model& model, std::span<const std::unique_ptr<Effect>> effects);

  // A frame with every array at its final capacity.
  Frame Make() const;

  // What the state alone says. Contacts, their forces and strain energies become "none" and zero.
  void Write(const State& state, Frame* frame) const;
  // Adds what the last sub-step has left behind: `load_n` [#particles, N] on the zones, the tools'
  // error bars (empty: none), and the effects' energies.
  void WriteForces(const State& state, std::span<const Vec3> load_n,
                   std::span<const ForceError::Bar> error_bar, Frame* frame) const;

 private:
  void WriteTools(const State& state, Frame* frame) const;

  const Model& model_;
  std::vector<const Effect*> elastic_;
  mutable ContactFrames contact_frames_;
  // Scratch of one frame, [#particles].
  mutable std::vector<std::uint8_t> collides_;
  mutable std::vector<double> energy_j_;  // empty when no effect is elastic
};

}  // namespace adhesim
