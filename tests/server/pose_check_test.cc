#include "server/pose_check.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/errors.h"

namespace adhesim {
namespace {

v1::Pose MakePose(double x, double qw) {
  v1::Pose pose;
  pose.set_x_m(x);
  pose.set_qw(qw);
  return pose;
}

std::string ReasonFor(const v1::Pose& pose) { return ReasonOf(CheckPose(pose).status()); }

TEST(PoseCheck, RefusesWhatIsNotFinite) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(ReasonFor(MakePose(kNan, 1)), "POSE_NOT_FINITE");
  EXPECT_EQ(ReasonFor(MakePose(kInfinity, 1)), "POSE_NOT_FINITE");
  EXPECT_EQ(ReasonFor(MakePose(0, kNan)), "POSE_NOT_FINITE");
  EXPECT_EQ(ReasonFor(MakePose(0, -kInfinity)), "POSE_NOT_FINITE");
}

TEST(PoseCheck, RefusesWhatIsNoRotation) {
  EXPECT_EQ(ReasonFor(MakePose(0, 0)), "POSE_NOT_A_ROTATION");
  EXPECT_EQ(ReasonFor(MakePose(0, 1.02)), "POSE_NOT_A_ROTATION");
  EXPECT_EQ(ReasonFor(MakePose(0, 0.98)), "POSE_NOT_A_ROTATION");
  // Squares overflow, the norm is infinite.
  EXPECT_EQ(ReasonFor(MakePose(0, 1e300)), "POSE_NOT_A_ROTATION");
}

TEST(PoseCheck, RefusesWhatIsTooFarAway) {
  EXPECT_EQ(ReasonFor(MakePose(1000.1, 1)), "POSE_OUT_OF_RANGE");
  EXPECT_EQ(ReasonFor(MakePose(-1e300, 1)), "POSE_OUT_OF_RANGE");
}

TEST(PoseCheck, NormalisesWhatIsNearlyARotation) {
  const absl::StatusOr<Pose> pose = CheckPose(MakePose(0.5, 1.009));
  ASSERT_TRUE(pose.ok());
  EXPECT_EQ(pose->position_m, Vec3(0.5, 0, 0));
  // One division: a rounding error.
  EXPECT_NEAR(pose->orientation.norm(), 1, 1e-15);
}

TEST(PoseCheck, SaysWhatIsWrongAndWhatIsPermitted) {
  const absl::Status status = CheckPose(MakePose(0, 1.5)).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_EQ(status.message(), "norm of the quaternion is 1.5, permitted are 0.99 to 1.01");
}

}  // namespace
}  // namespace adhesim
