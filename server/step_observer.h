#pragma once

#include <span>

#include "adhesim/v1/status.pb.h"
#include "core/engine/engine.h"

namespace adhesim {

struct SessionFrame;

// Sees all that a session does, in its order and on its stepping thread: so no call may wait (but
// see `may_wait`), allocate or throw.
class StepObserver {
 public:
  virtual ~StepObserver() = default;
  // After each step, also one that froze the engine; then `frame` is the last good one. `inputs`
  // [#tools] are what the step used. `may_wait`: these steps are made as fast as they can be, so
  // that the observer may take its time.
  virtual void OnStep(const Engine& engine, std::span<const ToolInput> inputs,
                      const SessionFrame& frame, bool may_wait) noexcept = 0;
  // `frame` shows the start.
  virtual void OnReset(const SessionFrame& frame) noexcept = 0;
  // Paused or goes on. Not when it freezes: OnStep() sees that.
  virtual void OnState(v1::SessionState state) noexcept = 0;
  // Last call, on another thread, when the stepping thread has ended. May take its time.
  virtual void OnEnd() noexcept = 0;
};

}  // namespace adhesim
