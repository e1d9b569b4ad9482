#pragma once

#include <span>

#include "core/model/geometry.h"

namespace adhesim {

// The rotation by the Cayley map of dt * angular velocity: (1, dt W / 2), normalised. Exact to
// third order in dt |W|, arithmetic and a square root only. Everything that rotates in a step
// rotates by it, tools included.
Quat RotationStep(const Vec3& angular_rad_s, double dt_s);

// What is left to turn about of something rigid of which points are held: any axis through its
// centre (none is held), any through a point, one, or nothing.
struct Hold {
  int points = 0;  // different ones: 0, 1, 2 on the axis, 3 nothing turns
  Vec3 point_m = Vec3::Zero();
  Vec3 axis = Vec3::Zero();

  void Add(const Vec3& x);
  void Lock() { points = 3; }
  bool free() const { return points == 0; }
  bool locked() const { return points == 3; }
  // The angular velocity per moment about the point, from the sum of m r r^T about it; 0 where
  // particles lie so nearly on a line that nothing can be said of turning about it.
  Mat3 InverseInertia(const Mat3& spread_kg_m2) const;
};

// The possible motions of the particles of one zone, and the inertia they have in them.
//
// q = (V, W) is the twist about `pivot`; v_i = V + W x (x_i - pivot). Nobody holds it: pivot is the
// centre of mass and all of q is free. Fixed particles leave the rotation about a point, about an
// axis, or nothing. A tool prescribes q. Where the particles have no inertia (one particle, or all
// on a line) the pseudo-inverse leaves out a rotation that moves nothing (physics notes 3.3, items
// 1 and 12).
struct RigidGroup {
  enum class Freedom { kFree, kPoint, kAxis, kLocked, kDriven };

  Freedom freedom = Freedom::kFree;
  double mass_kg = 0;            // of the particles that can move
  Vec3 centre_m = Vec3::Zero();  // their centre of mass
  Vec3 pivot_m = Vec3::Zero();
  Mat3 inertia = Mat3::Zero();           // kg m^2 about the pivot
  Mat3 inverse_inertia = Mat3::Zero();   // pseudo-inverse on the possible rotations
  Twist twist;                           // about the pivot, at the start of the move
  Vec3 linear_momentum = Vec3::Zero();   // P, kg m/s
  Vec3 angular_momentum = Vec3::Zero();  // L about the pivot, kg m^2/s
  // Result of Move().
  Mat3 rotation = Mat3::Identity();
  Vec3 moved_pivot_m = Vec3::Zero();
  Vec3 end_angular_rad_s = Vec3::Zero();

  // From the members' positions, masses and fixed flags; `tool` (null: nobody) is the pose that
  // prescribes the motion.
  static RigidGroup Of(std::span<const std::int32_t> members, std::span<const Vec3> position_m,
                       std::span<const double> mass_kg, std::span<const std::uint8_t> fixed,
                       const Pose* tool);

  // Momenta of the members at these velocities, and the twist that keeps as much of them as the
  // group's freedom allows: the mass-weighted projection. Conserves both momenta of a free group,
  // never gains kinetic energy.
  void Project(std::span<const std::int32_t> members, std::span<const Vec3> position_m,
               std::span<const double> mass_kg, std::span<const Vec3> velocity_m_s);
  // Adds an impulse and its moment about the pivot.
  void AddImpulse(const Vec3& impulse, const Vec3& moment);
  // The change of twist that an impulse would make.
  Twist Response(const Vec3& impulse, const Vec3& moment) const;
  bool driven() const { return freedom == Freedom::kDriven; }

  Vec3 VelocityAt(const Vec3& x) const {
    return twist.linear_m_s + twist.angular_rad_s.cross(x - pivot_m);
  }
  // Moves the group for dt: a free rotation keeps L and kinetic energy (implicit midpoint in the
  // body frame with the Cayley update; Austin, Krishnaprasad and Wang 1993), in sub-rotations when
  // it spins fast.
  void Move(double dt_s);
  Vec3 MovedPosition(const Vec3& x) const { return moved_pivot_m + rotation * (x - pivot_m); }
  Vec3 MovedVelocity(const Vec3& moved_x) const {
    return twist.linear_m_s + end_angular_rad_s.cross(moved_x - moved_pivot_m);
  }
};

}  // namespace adhesim
