#pragma once

#include <span>

#include "core/tools/bullet_bodies.h"

namespace adhesim {

// A rigid motion of a tool's tip along a straight line with a constant turn, by its fraction s in
// [0, 1].
struct Motion {
  Motion(const Pose& start, const Pose& end);
  Pose At(double s) const;

  Pose from;
  Vec3 shift_m;   // of the tip
  Vec3 turn_rad;  // rotation vector, world axes
};

// How far a tool can move, by conservative advancement over separating axes.
//
// A plane with normal n that has the tool on one side and a triangle on the other parts them for as
// long as the tool's extent e(s) = n . tip(s) + h(R(s)^T n) stays below the triangle's lowest point
// along n (h: the solid's support function). e(s) + k s^2 / 2 is convex for k = turn^2 * reach, so
// that between two instants D apart e(s) exceeds the line through its values by no more than k D^2
// / 8. A round therefore looks one segment ahead, at most so long that this stays below half a
// margin, finds the first crossing of that line for each triangle, advances to the earliest, and
// starts again with new axes; it ends at a margin's distance.
class Sweeper {
 public:
  Sweeper(const ToolBody& tool, const Motion& motion, double margin_m);

  // The box that holds the tool during the whole motion, a margin larger.
  const Aabb& box() const { return box_; }

  // A round: BeginRound() while it returns true, then everything that could be met.
  bool BeginRound();
  void Meet(const TriangleCorners& corners);
  void Meet(const ToolBody& other, const Pose& pose);

  double fraction() const { return fraction_; }
  // Towards the tool; of use when fraction() < 1.
  const Vec3& normal() const { return normal_; }

 private:
  // When the tool comes too near along one axis.
  struct Crossing {
    double gap_m;    // now; not positive: the axis does not part the two
    double spare_m;  // how much of the gap may be used up
    double share;    // of the segment until then; above 1: not in it
  };
  Crossing CrossingAlong(const Vec3& n, double obstacle_low, const Solid& solid) const;
  void Limit(const Crossing& crossing, const Vec3& n);
  void MeetSolids(int solid, const ToolBody& other, int other_solid, const Pose& pose);

  const ToolBody& tool_;
  Motion motion_;
  double margin_m_;
  double travel_m_;  // bound on the motion of any point of the tool
  double segment_;   // longest segment, as a fraction
  Aabb box_;

  int rounds_ = 0;
  bool done_ = false;
  double fraction_ = 0;
  Vec3 normal_ = Vec3::UnitZ();
  // Of this round's segment; positions from the motion's start, so that nothing is lost far from
  // the world's origin.
  Pose now_, ahead_;
  double length_ = 0;
  bool last_segment_ = false;
  double share_ = 2;  // earliest crossing so far
  double spare_m_ = 0;
};

}  // namespace adhesim
