#include "core/tools/sweep.h"

#include <algorithm>
#include <cmath>

#include "core/tools/gjk.h"
#include "core/tools/rotation.h"

namespace adhesim {
namespace {

// Rounds are few (a head-on meeting takes 2); a fast turn of a long tool takes one a segment.
// Ending early is safe.
constexpr int kMaxRounds = 1000;

// A crossing is final when no more than this share of the margin is left to use.
constexpr double kCloseEnough = 1e-3;

// Motion along a surface that is already within the margin may come nearer by this share:
// round-off.
constexpr double kRoundOff = 1e-6;

}  // namespace

Motion::Motion(const Pose& start, const Pose& end)
    : from(start),
      shift_m(end.position_m - start.position_m),
      turn_rad(VectorOf((end.orientation * start.orientation.conjugate()).normalized())) {}

Pose Motion::At(double s) const {
  return {from.position_m + s * shift_m,
          (RotationOf(s * turn_rad) * from.orientation).normalized()};
}

Sweeper::Sweeper(const ToolBody& tool, const Motion& motion, double margin_m)
    : tool_(tool), motion_(motion), margin_m_(margin_m) {
  const double angle = motion.turn_rad.norm();
  const double curvature = angle * angle * tool.reach_m();
  travel_m_ = motion.shift_m.norm() + angle * tool.reach_m();
  segment_ = curvature > 0 ? std::min(1.0, std::sqrt(4 * margin_m / curvature)) : 1;
  box_.Add(tool.BoxAt(motion.from));
  box_.Add(tool.BoxAt(motion.At(1)));
  box_ = box_.Grown(margin_m + curvature / 8);
}

bool Sweeper::BeginRound() {
  if (rounds_ > 0 && !done_) {
    // What the last round found.
    if (share_ > 1) {
      fraction_ = last_segment_ ? 1 : fraction_ + length_;
      done_ = last_segment_;
    } else {
      fraction_ += share_ * length_;
      done_ = spare_m_ <= kCloseEnough * margin_m_;
    }
  }
  if (done_ || rounds_ == kMaxRounds) return false;
  ++rounds_;
  length_ = std::min(segment_, 1 - fraction_);
  last_segment_ = fraction_ + length_ > 1 - 1e-12;
  now_ = motion_.At(fraction_);
  ahead_ = motion_.At(fraction_ + length_);
  now_.position_m -= motion_.from.position_m;
  ahead_.position_m -= motion_.from.position_m;
  share_ = 2;
  return true;
}

Sweeper::Crossing Sweeper::CrossingAlong(const Vec3& n, double obstacle_low,
                                         const Solid& solid) const {
  const auto gap_at = [&](const Pose& pose) {
    return obstacle_low - n.dot(pose * SupportPoint(solid, pose.orientation.conjugate() * n));
  };
  const double gap = gap_at(now_), gap_ahead = gap_at(ahead_);
  // Nearer than the margin already (or overlapping): no nearer than now.
  const double limit =
      gap > 0 ? std::min(margin_m_, gap * (1 - kRoundOff)) : gap - kRoundOff * margin_m_;
  const double spare = gap - limit;
  if (gap_ahead >= limit) return {gap, spare, 2};
  return {gap, spare, spare / (gap - gap_ahead)};
}

void Sweeper::Limit(const Crossing& crossing, const Vec3& n) {
  if (crossing.share > 1 || crossing.share >= share_) return;
  share_ = crossing.share;
  spare_m_ = crossing.spare_m;
  normal_ = -n;
}

void Sweeper::Meet(const TriangleCorners& world) {
  TriangleCorners corners;  // from the motion's start
  for (int k = 0; k < 3; ++k) corners[k] = world[k] - motion_.from.position_m;
  const auto low_along = [&](const Vec3& n) {
    return std::min({n.dot(corners[0]), n.dot(corners[1]), n.dot(corners[2])});
  };
  const Vec3 cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  const double area = cross.norm();
  TriangleCorners local;
  const Mat3 to_tool = now_.orientation.conjugate().toRotationMatrix();
  for (int k = 0; k < 3; ++k) local[k] = to_tool * (corners[k] - now_.position_m);
  for (const Solid& solid : tool_.solids()) {
    SolidNearest nearest;
    if (!NearestOnTriangle(solid, local, travel_m_ + 2 * margin_m_, &nearest)) continue;
    Vec3 n = now_.orientation * nearest.normal;
    Crossing crossing = CrossingAlong(n, low_along(n), solid);
    // Any axis that parts the two will do. The triangle's own keeps a tool that slides over a flat
    // surface from being caught by the edges between its triangles.
    if (crossing.share <= 1 && area > 0) {
      for (const double side : {-1.0, 1.0}) {
        const Vec3 face = side / area * cross;
        const Crossing along_face = CrossingAlong(face, low_along(face), solid);
        if (along_face.gap_m > 0 && along_face.share > crossing.share) {
          crossing = along_face;
          n = face;
        }
      }
    }
    Limit(crossing, n);
  }
}

void Sweeper::Meet(const ToolBody& other, const Pose& world) {
  const Pose pose{world.position_m - motion_.from.position_m, world.orientation};
  Aabb reach = box_;
  reach.min -= motion_.from.position_m;
  reach.max -= motion_.from.position_m;
  if (!reach.Overlaps(other.BoxAt(pose))) return;
  for (int mine = 0; mine < static_cast<int>(tool_.solids().size()); ++mine) {
    for (int theirs = 0; theirs < static_cast<int>(other.solids().size()); ++theirs) {
      MeetSolids(mine, other, theirs, pose);
    }
  }
}

void Sweeper::MeetSolids(int mine, const ToolBody& other, int theirs, const Pose& pose) {
  const Solid& a = tool_.solids()[mine];
  const Solid& b = other.solids()[theirs];
  const auto support_a = [&](const Vec3& d) {
    return Vec3(now_ * SupportPoint(a, now_.orientation.conjugate() * d));
  };
  const auto support_b = [&](const Vec3& d) {
    return Vec3(pose * SupportPoint(b, pose.orientation.conjugate() * d));
  };
  const GjkResult gjk = Gjk(support_a, [&](const Vec3& d) { return SupportOfB{support_b(d)}; });
  const double distance = gjk.from_a_to_b.norm();
  Vec3 n;
  if (gjk.overlap || distance < 1e-12) {
    const Quat back = now_.orientation.conjugate();
    const Pose relative{back * (pose.position_m - now_.position_m),
                        (back * pose.orientation).normalized()};
    n = now_.orientation * tool_.OverlapDirection(mine, other, theirs, relative);
  } else {
    n = gjk.from_a_to_b / distance;
  }
  Limit(CrossingAlong(n, n.dot(support_b(-n)), a), n);
}

}  // namespace adhesim
