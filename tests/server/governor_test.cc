#include "server/governor.h"

#include <gtest/gtest.h>

#include <functional>
#include <utility>
#include <vector>

namespace adhesim {
namespace {

constexpr double kBudgetS = 8e-4;
constexpr double kDtS = 1e-3;

using Changes = std::vector<std::pair<int, int>>;  // step, rung from then on

// The part of a step's cost that is left with so many rungs given up.
constexpr double kLeft[] = {1, 0.75, 0.6};

// Runs a governor of two rungs on steps whose cost at full fidelity is `load` of the budget.
Changes Govern(int steps, const std::function<double(int)>& load) {
  Governor governor({kBudgetS, kDtS, 2});
  Changes changes;
  int rung = 0;
  for (int step = 0; step < steps; ++step) {
    const int next = governor.Observe(kBudgetS * load(step) * kLeft[rung]);
    if (next != rung) changes.emplace_back(step, next);
    rung = next;
  }
  EXPECT_EQ(governor.changes(), changes.size());
  return changes;
}

std::vector<int> RungsOf(const Changes& changes) {
  std::vector<int> rungs;
  for (const auto& [step, rung] : changes) rungs.push_back(rung);
  return rungs;
}

TEST(Governor, GoesDownRungByRungWhenCostDoublesAndComesBack) {
  const Changes changes =
      Govern(20'000, [](int step) { return step >= 1000 && step < 8000 ? 1.4 : 0.6; });
  // 1.4 * 0.75 is still too much, 1.4 * 0.6 fits.
  ASSERT_EQ(RungsOf(changes), (std::vector<int>{1, 2, 1, 0}));
  // Down at once: a dozen steps tell one in twenty from an accident. Up no sooner than it fits for
  // a second, and within a few.
  EXPECT_LT(changes[0].first, 1020);
  EXPECT_LT(changes[1].first, 1040);
  EXPECT_GT(changes[2].first, 8000 + 1000);
  EXPECT_GT(changes[3].first, changes[2].first + 1000);
  EXPECT_LT(changes[3].first, 8000 + 4000);
}

TEST(Governor, GoesNoFurtherThanItMust) {
  EXPECT_EQ(RungsOf(Govern(20'000, [](int) { return 1.2; })), std::vector<int>{1});
  EXPECT_EQ(RungsOf(Govern(20'000, [](int) { return 0.95; })), std::vector<int>{});
  // Nothing is left to give up: it stays there.
  EXPECT_EQ(RungsOf(Govern(20'000, [](int) { return 3.0; })), (std::vector<int>{1, 2}));
}

// A rung that halves the cost leaves room to spare, but not for going back.
TEST(Governor, RemembersWhatGoingDownSaved) {
  Governor governor({kBudgetS, kDtS, 1});
  for (int step = 0; step < 20'000; ++step) {
    governor.Observe(kBudgetS * (governor.rung() == 0 ? 1.2 : 0.6));
  }
  EXPECT_EQ(governor.rung(), 1);
  EXPECT_EQ(governor.changes(), 1u);
}

TEST(Governor, LeavesSingleSlowStepsAlone) {
  // One step in fifty is ten times as slow: less often than one in twenty.
  EXPECT_TRUE(Govern(100'000, [](int step) { return step % 50 == 49 ? 5.0 : 0.5; }).empty());
}

// The worst case: a load that falls just long enough for a rung to be regained, and returns.
TEST(Governor, RegainsMoreAndMoreRarelyWhatItHadToGiveUpAgain) {
  const int steps = 1'000'000;
  const Changes changes = Govern(steps, [](int step) { return step % 2500 < 500 ? 1.2 : 0.4; });
  // Naively there would be 400 periods with two changes each. Patience doubles from 1 s; a load
  // that is low for 2 s at most is soon waited out.
  EXPECT_LT(changes.size(), 20u);
  for (const auto& [step, rung] : changes) EXPECT_LE(rung, 1);
}

TEST(Governor, DoesNotOscillateUnderALoadThatItMisjudges) {
  // At full fidelity there is something that the lower rung does not show: whatever the cost was
  // when it went down, it seems to fit, and never does.
  Governor governor({kBudgetS, kDtS, 1});
  int rung = 0, changes = 0;
  for (int step = 0; step < 600'000; ++step) {
    const bool first = step < 20;  // went down for a small excess
    const double load = rung == 0 ? (first ? 1.01 : 1.5) : (first ? 1.0 : 0.3);
    const int next = governor.Observe(kBudgetS * load);
    changes += next != rung;
    rung = next;
  }
  // Ten minutes; waits of 1, 2, 4 .. 64 s make 64 + 600 / 64 times two changes at the very most.
  EXPECT_LT(changes, 2 * (7 + 600 / 64 + 1));
}

TEST(Governor, GivesTheSameDecisionsForTheSameCostsAndAfterReset) {
  Governor a({kBudgetS, kDtS, 2}), b({kBudgetS, kDtS, 2});
  for (int step = 0; step < 500; ++step) b.Observe(2 * kBudgetS);
  b.Reset();
  EXPECT_EQ(b.rung(), 0);
  for (int step = 0; step < 5000; ++step) {
    const double cost = kBudgetS * (0.6 + 0.6 * ((step / 700) % 2));
    ASSERT_EQ(a.Observe(cost), b.Observe(cost)) << step;
  }
}

TEST(Governor, LowersNothingWithoutABudgetOrRungs) {
  for (const Governor::Options& options :
       {Governor::Options{0, kDtS, 2}, Governor::Options{kBudgetS, kDtS, 0}}) {
    Governor governor(options);
    for (int step = 0; step < 1000; ++step) ASSERT_EQ(governor.Observe(1), 0);
    EXPECT_EQ(governor.changes(), 0u);
  }
}

}  // namespace
}  // namespace adhesim
