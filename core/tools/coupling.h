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
// integrated by backward Euler over dt_s: stable for any stiffness. The spring's force and torque,
// and the tool's speed, are clipped to the parameters' limits.
CouplingResult FollowTarget(const CouplingParameters& parameters, const Pose& pose,
                            const Twist& twist, const Pose& target, const Mat6& inertia,
                            const Wrench& applied, double dt_s);

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
