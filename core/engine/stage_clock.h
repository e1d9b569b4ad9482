#pragma once

#include <ctime>
#include <string>
#include <vector>

#include "core/engine/engine.h"

namespace adhesim {

// Wall time of each stage of a step, summed over its sub-steps. Off, it costs one branch a stage.
class StageClock {
 public:
  int Add(Engine::Stage stage) {
    stages_.push_back(std::move(stage));
    spent_us_.push_back(0);
    return static_cast<int>(stages_.size()) - 1;
  }
  void Enable(std::size_t capacity) {
    capacity_ = capacity;
    for (Engine::Stage& stage : stages_) {
      stage.us.clear();
      stage.us.reserve(capacity);
    }
    next_ = 0;
  }
  void BeginStep() {
    if (capacity_ == 0) return;
    std::fill(spent_us_.begin(), spent_us_.end(), 0.0);
    last_us_ = NowUs();
  }
  // Gives the time since the last call to a stage.
  void Lap(int stage) {
    if (capacity_ == 0) return;
    const double now = NowUs();
    spent_us_[stage] += now - last_us_;
    last_us_ = now;
  }
  void EndStep() {
    if (capacity_ == 0) return;
    for (std::size_t s = 0; s < stages_.size(); ++s) {
      if (stages_[s].us.size() < capacity_) {
        stages_[s].us.push_back(static_cast<float>(spent_us_[s]));
      } else {
        stages_[s].us[next_] = static_cast<float>(spent_us_[s]);
      }
    }
    next_ = (next_ + 1) % capacity_;
  }
  std::span<const Engine::Stage> stages() const { return stages_; }

 private:
  static double NowUs() {
    timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
  }
  std::vector<Engine::Stage> stages_;
  std::vector<double> spent_us_;
  std::size_t capacity_ = 0;
  std::size_t next_ = 0;
  double last_us_ = 0;
};

}  // namespace adhesim
