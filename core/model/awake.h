#pragma once

#include <span>

#include "core/model/state.h"

namespace adhesim {

// The particles of what does not sleep, as ascending ranges: all `count` of them in one where the
// scene lets nothing sleep.
//   for (const auto& [begin, end] : AwakeRanges(count, sleep)) ...
class AwakeRanges {
 public:
  AwakeRanges(int count, const Sleep& sleep)
      : all_{0, count}, some_(sleep.awake), sleeps_(!sleep.asleep.empty()) {}
  const ParticleRange* begin() const { return sleeps_ ? some_.data() : &all_; }
  const ParticleRange* end() const { return sleeps_ ? some_.data() + some_.size() : &all_ + 1; }

 private:
  ParticleRange all_;
  std::span<const ParticleRange> some_;
  bool sleeps_;
};

}  // namespace adhesim
