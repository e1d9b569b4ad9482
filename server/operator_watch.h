#pragma once

#include <cstdint>

#include "core/engine/engine.h"

namespace adhesim {

// Decides what a tool is asked to do when its operator falls silent. Counted in steps, never by a
// clock, so that a recording of ToolInputs replays it:
//   250 ms without a pose: the tool holds its last target, and says so;
//   2 s: the strength of its bonds fades to nothing within 0.5 s; then it is retracted;
//   the next pose: everything as before.
// A tool that never had a pose follows its script and is never lost.
class OperatorWatch {
 public:
  explicit OperatorWatch(double dt_s);

  // The input of the next step. `pose`: a new one, or null.
  const ToolInput& Next(const Pose* pose);
  // As before the first pose.
  void Reset();

  bool operator_lost() const { return input_.has_target && silent_steps_ >= hold_after_; }
  // The input that Next() returned last.
  const ToolInput& input() const { return input_; }

 private:
  std::int64_t hold_after_;  // all in steps since the last pose
  std::int64_t fade_after_;
  std::int64_t retract_after_;
  std::int64_t silent_steps_ = 0;
  ToolInput input_;
};

}  // namespace adhesim
