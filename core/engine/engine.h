#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/simd.h"
#include "core/model/state.h"

namespace adhesim {

// What an operator (or nobody) wants of a tool in one step. Inputs are all that a step takes from
// outside.
struct ToolInput {
  bool has_target = false;  // false: follow the scripted trajectory, or hold when there is none
  Pose target;              // finite, unit quaternion: the caller has checked
  double strength_scale =
      1;  // multiplies the tool's bond strength, 0..1 (an operator lost: ramps to 0)
  bool retracted = false;  // true: let go of everything and touch nothing
};

// Something that steps can do without for a while, to save time (docs/governor.md).
struct FidelityRung {
  const char* name;  // a literal
  // What it is expected to cost in accuracy, with the rungs before it: as the scene says that it
  // was measured, else bounds over this repository's scenes.
  double force_error;     // of a tool's force, part of its peak
  double position_error;  // of surfaces, part of their body's size
  bool measured = false;  // by a study of the scene
};

// One scene in motion. Not thread-safe: one owner thread at a time.
//
// Step() allocates nothing, locks nothing, throws nothing, and gives the same bits for any number
// of threads and any instruction set.
class Engine {
 public:
  struct Options {
    int threads = 1;         // worker threads including the caller's, 1..64
    Simd simd = BestSimd();  // one of AvailableSimd()
  };

  // Compiles the model's effects into a pipeline. Errors: InvalidArgument for an effect that was
  // not compiled in, a scene that needs more sub-steps than it permits or names a rung that it does
  // not have, an option out of range.
  static absl::StatusOr<std::unique_ptr<Engine>> Create(std::shared_ptr<const Model> model,
                                                        const Options& options);
  virtual ~Engine() = default;

  // Advances by Model::dt_s. `tools` has one entry a tool, or is empty (every tool on its
  // trajectory). A non-finite state freezes the engine: the report says so, and from then on Step()
  // changes nothing.
  virtual StepReport Step(std::span<const ToolInput> tools) = 0;

  // What can be given up, in the order in which it is; empty: nothing.
  virtual std::span<const FidelityRung> rungs() const { return {}; }
  // Gives up the first `rungs` of them (0: none, at most all) from the next step on. As much an
  // input of the steps as tools are: the same ones at the same steps give the same bits. Reset()
  // and Restore() leave it; after Restore() in the midst of lowered steps, bits are those of a
  // first one.
  virtual void SetFidelity(int /*rungs*/) {}
  virtual int fidelity() const { return 0; }

  virtual const Model& model() const = 0;
  virtual const State& state() const = 0;
  virtual bool frozen() const = 0;
  // Why: what became non-finite, where and in which step; empty while the engine is not frozen.
  // Allocates.
  virtual std::string FrozenBecause() const { return ""; }
  // Sub-steps of a step by the stability bound (tools and fast particles may need more).
  virtual int substeps() const = 0;
  // Back to the start, or to any earlier state of this engine.
  virtual void Reset() = 0;
  virtual void Restore(const State& state) = 0;

  // A frame with every array at its final capacity.
  virtual Frame MakeFrame() const = 0;
  // Fills a frame made by MakeFrame(); allocates nothing.
  virtual void WriteFrame(Frame* frame) const = 0;
  // Of positions, velocities, zones' momenta, bonds and tools; the same on every machine of one
  // architecture.
  virtual std::uint64_t StateHash() const = 0;
  // Kinetic plus elastic energy now, J. May allocate.
  virtual double MechanicalEnergy() const = 0;
  // What steps keep instead, J. In implicit ones it is the same. Explicit ones are symplectic: of
  // springs they keep H + dt/2 f.v exactly, while H itself swings about it by up to its w dt / 2-th
  // part (0.5 at the default fraction of the stability bound) without ever growing (Hairer, Lubich,
  // Wanner: Geometric Numerical Integration, chapter IX). May allocate.
  virtual double KeptEnergy() const { return MechanicalEnergy(); }

  // How much of its own momentum a tool exchanged with what it caught in the last step, N s: the
  // sizes of its changes at all captures, added up, whether what was caught was let go again or
  // not.
  virtual double CaptureImpulse(int /*tool*/) const { return 0; }

  // One stage of the compiled pipeline.
  struct Stage {
    std::string name;
    std::string reason;              // why it is there, in words
    std::vector<std::string> paths;  // the parts of the scene that asked for it: "effects[0].drag"
    std::size_t bytes = 0;           // of its arrays, if nothing else took memory meanwhile
    std::vector<float> us = {};      // wall time of the latest steps (ring), only when timing is on
  };
  virtual std::span<const Stage> stages() const = 0;
  // Times every stage of the next `capacity` steps; 0 switches it off. Allocates here, not in
  // Step().
  virtual void TimeStages(std::size_t capacity) = 0;
};

}  // namespace adhesim
