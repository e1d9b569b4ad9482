#pragma once

#include <array>
#include <cstdint>

namespace adhesim {

// Decides how much fidelity a session gives up so that its steps end in time (docs/governor.md).
//
// It sees what steps cost and nothing else, consults no clock, and allocates nothing: the same
// costs give the same decisions. Down by one rung when about one step in twenty exceeds the budget,
// and again once it is seen that this did not suffice. Up by one when for a while the step that it
// leads to was predicted to fit with room to spare, from what going down saved. A rung that had to
// be given up again soon after it was regained waits twice as long the next time, so that there is
// no oscillation under a steady load.
class Governor {
 public:
  static constexpr int kMaxRungs = 8;
  struct Options {
    double budget_s = 0;  // that a step may take; 0: fidelity is never lowered
    double dt_s = 1e-3;   // of a step
    int rungs = 0;        // that can be given up; those beyond kMaxRungs never are
  };

  Governor() = default;  // never lowers anything
  explicit Governor(const Options& options);

  // What the last step took, s. Returns the rungs to give up in the next one.
  int Observe(double cost_s);
  // Full fidelity, and nothing is known of costs.
  void Reset();

  int rung() const { return rung_; }
  double budget_s() const { return options_.budget_s; }
  std::uint64_t changes() const { return changes_; }

 private:
  static constexpr int kWindow = 9;  // costs
  std::uint64_t LeastPatience() const;
  void MoveTo(int rung);
  double WindowMedian() const;
  bool MayRaise() const;

  Options options_;
  int rung_ = 0;
  std::uint64_t changes_ = 0;
  double high_s_ = 0;  // about the 95th percentile of costs
  std::array<double, kWindow> window_{};
  std::uint64_t since_change_ = 0;  // steps
  std::uint64_t fits_ = 0;          // steps in a row for which the rung above was predicted to fit
  bool went_down_ = false;          // the last change
  // Of each rung r: what a step costs with it given up, part of the cost without. And how many
  // steps it must seem to fit before it is regained.
  std::array<double, kMaxRungs> ratio_{};
  std::array<std::uint64_t, kMaxRungs> patience_{};
  double before_s_ = 0;  // the median cost when the last change was decided
};

}  // namespace adhesim
