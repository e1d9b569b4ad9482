#include "server/governor.h"

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

constexpr double kQuantile = 0.95;
constexpr double kGain = 0.05;         // of the budget: how far the estimate moves at most, by step
constexpr double kFresh = 0.5;         // of the budget: the estimate after a change
constexpr double kRoom = 0.7;          // of the budget, for the rung above to be regained
constexpr double kPatienceS = 1;       // of simulated time, before that
constexpr double kPatienceSteps = 64;  // and at least so many steps
constexpr std::uint64_t kMostPatience = 64;  // times the least

}  // namespace

Governor::Governor(const Options& options) : options_(options) {
  options_.rungs = std::clamp(options.rungs, 0, kMaxRungs);
  Reset();
}

void Governor::Reset() {
  rung_ = 0;
  changes_ = since_change_ = fits_ = 0;
  went_down_ = false;
  high_s_ = kFresh * options_.budget_s;
  before_s_ = 0;
  window_.fill(0);
  ratio_.fill(1);
  patience_.fill(LeastPatience());
}

std::uint64_t Governor::LeastPatience() const {
  return static_cast<std::uint64_t>(
      std::max(kPatienceSteps, std::ceil(kPatienceS / options_.dt_s)));
}

double Governor::WindowMedian() const {
  std::array<double, kWindow> sorted = window_;
  std::nth_element(sorted.begin(), sorted.begin() + kWindow / 2, sorted.end());
  return sorted[kWindow / 2];
}

void Governor::MoveTo(int rung) {
  went_down_ = rung > rung_;
  before_s_ = WindowMedian();
  rung_ = rung;
  high_s_ = kFresh * options_.budget_s;
  since_change_ = fits_ = 0;
  ++changes_;
}

// What the rung above would cost, from what going down to this one saved.
bool Governor::MayRaise() const {
  return rung_ > 0 && high_s_ <= kRoom * options_.budget_s * ratio_[rung_ - 1];
}

int Governor::Observe(double cost_s) {
  if (options_.rungs == 0 || !(options_.budget_s > 0)) return 0;
  window_[since_change_++ % kWindow] = cost_s;
  // A running quantile: it rests where one step in twenty is above it.
  high_s_ += kGain * options_.budget_s * (cost_s > high_s_ ? kQuantile : kQuantile - 1);
  if (since_change_ < kWindow) return rung_;
  if (since_change_ == kWindow && went_down_ && before_s_ > 0) {
    ratio_[rung_ - 1] = std::clamp(WindowMedian() / before_s_, 0.1, 1.0);
  }
  if (high_s_ > options_.budget_s && rung_ < options_.rungs) {
    std::uint64_t& patience = patience_[rung_];
    // Regained too soon: not so soon again. Held for long: as at the start.
    if (changes_ > 0 && !went_down_ && since_change_ < 4 * patience) {
      patience = std::min(2 * patience, kMostPatience * LeastPatience());
    } else if (!went_down_) {
      patience = LeastPatience();
    }
    MoveTo(rung_ + 1);
    return rung_;
  }
  fits_ = MayRaise() ? fits_ + 1 : 0;
  if (rung_ > 0 && fits_ >= patience_[rung_ - 1]) MoveTo(rung_ - 1);
  return rung_;
}

}  // namespace adhesim
