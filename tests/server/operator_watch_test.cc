#include "server/operator_watch.h"

#include <gtest/gtest.h>

namespace adhesim {
namespace {

// At 1 kHz a step is a millisecond: the times of the contract as counts.
constexpr double kDtS = 1e-3;

void Silence(OperatorWatch* watch, int steps) {
  for (int i = 0; i < steps; ++i) watch->Next(nullptr);
}

TEST(OperatorWatch, LeavesAToolWithoutOperatorToItsScript) {
  OperatorWatch watch(kDtS);
  Silence(&watch, 5000);
  EXPECT_FALSE(watch.input().has_target);
  EXPECT_FALSE(watch.operator_lost());
  EXPECT_FALSE(watch.input().retracted);
  EXPECT_EQ(watch.input().strength_scale, 1);
}

TEST(OperatorWatch, HoldsTheTargetAndSaysSoAfter250Ms) {
  OperatorWatch watch(kDtS);
  const Pose pose{Vec3(1, 2, 3), Quat::Identity()};
  watch.Next(&pose);
  Silence(&watch, 249);
  EXPECT_FALSE(watch.operator_lost());
  Silence(&watch, 1);
  EXPECT_TRUE(watch.operator_lost());
  EXPECT_TRUE(watch.input().has_target);
  EXPECT_EQ(watch.input().target.position_m, pose.position_m);
  EXPECT_EQ(watch.input().strength_scale, 1);
}

TEST(OperatorWatch, FadesAfter2SAndRetractsHalfASecondLater) {
  OperatorWatch watch(kDtS);
  const Pose pose;
  watch.Next(&pose);
  Silence(&watch, 2000);
  EXPECT_EQ(watch.input().strength_scale, 1);
  Silence(&watch, 250);
  EXPECT_DOUBLE_EQ(watch.input().strength_scale, 0.5);
  EXPECT_FALSE(watch.input().retracted);
  Silence(&watch, 249);
  EXPECT_FALSE(watch.input().retracted);
  EXPECT_GT(watch.input().strength_scale, 0);
  Silence(&watch, 1);
  EXPECT_TRUE(watch.input().retracted);
  EXPECT_EQ(watch.input().strength_scale, 0);
  Silence(&watch, 10'000);
  EXPECT_TRUE(watch.input().retracted);
}

TEST(OperatorWatch, GoesBackToNormalWithTheNextPose) {
  OperatorWatch watch(kDtS);
  const Pose pose;
  watch.Next(&pose);
  Silence(&watch, 3000);
  watch.Next(&pose);
  EXPECT_FALSE(watch.operator_lost());
  EXPECT_FALSE(watch.input().retracted);
  EXPECT_EQ(watch.input().strength_scale, 1);
  Silence(&watch, 249);
  EXPECT_FALSE(watch.operator_lost());
}

TEST(OperatorWatch, CountsInStepsWhateverTheRate) {
  OperatorWatch watch(1.0 / 20);  // 250 ms are 5 steps, 2 s are 40
  const Pose pose;
  watch.Next(&pose);
  Silence(&watch, 4);
  EXPECT_FALSE(watch.operator_lost());
  Silence(&watch, 1);
  EXPECT_TRUE(watch.operator_lost());
  Silence(&watch, 45);
  EXPECT_TRUE(watch.input().retracted);
}

}  // namespace
}  // namespace adhesim
