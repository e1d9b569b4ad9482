#include "core/model/geometry.h"

#include <gtest/gtest.h>

#include <numbers>

namespace adhesim {
namespace {

TEST(Pose, TurnsThenMoves) {
  const Pose pose{Vec3(1, 2, 3), Quat(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitZ()))};
  // A quarter turn about z takes x to y; a few roundings of numbers near 1.
  EXPECT_LT((pose * Vec3(5, 0, 0) - Vec3(1, 7, 3)).norm(), 1e-14);
}

TEST(CrossMatrix, TimesAVectorIsTheCrossProduct) {
  const Vec3 a(1, -2, 3), b(4, 5, -6);
  // Small integers: exact.
  EXPECT_EQ(CrossMatrix(a) * b, a.cross(b));
}

TEST(Aabb, StartsEmpty) {
  const Aabb empty;
  Aabb everything;
  everything.Add(Vec3::Constant(-1e300));
  everything.Add(Vec3::Constant(1e300));
  EXPECT_FALSE(empty.Overlaps(everything));
  EXPECT_FALSE(everything.Overlaps(empty));
  EXPECT_FALSE(empty.Contains(Vec3::Zero()));
}

TEST(Aabb, OverlapsWhenTouchingOnEveryAxis) {
  const Aabb box{Vec3::Zero(), Vec3::Ones()};
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 step = Vec3::Unit(axis);
    EXPECT_TRUE(box.Overlaps({box.min + step, box.max + step})) << "axis " << axis;
    EXPECT_FALSE(box.Overlaps({box.min + 1.001 * step, box.max + 1.001 * step})) << "axis " << axis;
    EXPECT_FALSE(box.Overlaps({box.min - 1.001 * step, box.max - 1.001 * step})) << "axis " << axis;
  }
}

TEST(Aabb, GrowsOnEverySide) {
  const Aabb grown = Aabb{Vec3::Zero(), Vec3::Ones()}.Grown(0.5);
  EXPECT_EQ(grown.min, Vec3::Constant(-0.5));
  EXPECT_EQ(grown.max, Vec3::Constant(1.5));
}

}  // namespace
}  // namespace adhesim
