#include "server/operator_watch.h"

#include <cmath>

namespace adhesim {
namespace {

constexpr double kHoldAfterS = 0.25;
constexpr double kFadeAfterS = 2.0;
constexpr double kFadeS = 0.5;

std::int64_t Steps(double time_s, double dt_s) {
  return std::llround(std::ceil(time_s / dt_s - 1e-9));
}

}  // namespace

OperatorWatch::OperatorWatch(double dt_s)
    : hold_after_(Steps(kHoldAfterS, dt_s)),
      fade_after_(Steps(kFadeAfterS, dt_s)),
      retract_after_(Steps(kFadeAfterS + kFadeS, dt_s)) {}

const ToolInput& OperatorWatch::Next(const Pose* pose) {
  if (pose != nullptr) {
    silent_steps_ = 0;
    input_ = ToolInput{};
    input_.has_target = true;
    input_.target = *pose;
    return input_;
  }
  if (!input_.has_target || silent_steps_ > retract_after_) return input_;
  ++silent_steps_;
  if (silent_steps_ <= fade_after_) return input_;
  input_.retracted = silent_steps_ >= retract_after_;
  input_.strength_scale = input_.retracted
                              ? 0.0
                              : 1.0 - static_cast<double>(silent_steps_ - fade_after_) /
                                          static_cast<double>(retract_after_ - fade_after_);
  return input_;
}

void OperatorWatch::Reset() {
  silent_steps_ = 0;
  input_ = ToolInput{};
}

}  // namespace adhesim
