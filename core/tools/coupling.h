#pragma once

#include "core/model/geometry.h"
#include "core/model/model.h"

namespace adhesim {

// What the virtual coupling decides for one sub-step.
struct CouplingResult {
  Twist twist;    // of the tip, for the coming sub-step
  Wrench wrench;  // of the coupling on the tool, about the tip, limits applied
  bool force_limited = false;
  bool speed_limited = false;
};

// The tool's next twist: a rigid body of `inertia` (6 x 6 about the tip: linear first, angular
// second; the tool's own mass plus that of the tissue it carries) pulled by a critically damped
// spring towards `target` and by `applied` (the forces on the tissue it carries, about the tip),
// integrated by backward Euler over dt_s: stable for any stiffness. The spring's force and torque
// are clipped to the parameters' limits, and so is the speed that they aim at; what the tissue's
// forces make of it is not cut, since nothing would exert that.
CouplingResult FollowTarget(const CouplingParameters& parameters, const Pose& pose,
                            const Twist& twist, const Pose& target, const Mat6& inertia,
                            const Wrench& applied, double dt_s);

// The same coupling for who finds the tool's velocity together with that of what it holds: in a
// sub-step its impulse on the tool is `impulse` - `resistance` u, u the twist to come.
struct CouplingLaw {
  Mat6 resistance;  // dt D + dt^2 K, D critical for the inertia given
  Vec6 impulse;     // dt K e
};
CouplingLaw LawOf(const CouplingParameters& parameters, const Pose& pose, const Pose& target,
                  const Mat6& inertia, double dt_s);
// Where the law's wrench at this twist is beyond the limits, the law becomes the limited wrench,
// whatever the twist. Returns the wrench, and in `*limited` whether it was.
Vec6 LimitWrench(const CouplingParameters& parameters, const Vec6& twist, double dt_s,
                 CouplingLaw* law, bool* limited);
// Limits the speed, and the approach to the target to what the limited force can brake; `before` is
// the twist of the sub-step before. True where it was too fast.
bool LimitTwist(const CouplingParameters& parameters, const Pose& pose, const Pose& target,
                const Mat6& inertia, const Vec6& before, double dt_s, Vec6* twist);

// max_speed_m_s holds for every point of a tool this near to its tip, m.
inline constexpr double kSpeedRadius = 0.1;

// From the tip to the far end, m.
double ToolLength(const ToolModel& tool);

// The tool's own inertia about its tip, from CouplingParameters::mass_kg and the tool's length.
Mat6 ToolInertia(const ToolModel& tool, const Pose& pose);

// The pose after moving by a constant twist of the tip for dt_s.
Pose Advance(const Pose& pose, const Twist& twist, double dt_s);

// The pose on a trajectory at a time: linear in position, spherical in orientation; held before and
// after.
Pose PoseAt(const std::vector<TimedPose>& trajectory, double time_s);

}  // namespace adhesim
