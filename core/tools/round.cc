#include <algorithm>
#include <cmath>

#include "core/tools/nearest.h"

namespace adhesim {
namespace {

using Vec2 = Eigen::Vector2d;

// Points of the profile (rho, z): apex, shoulder, rim; the end face closes it.
struct Profile {
  Vec2 apex, shoulder, rim, end;
  Vec2 cone_normal;  // unit, outwards
};

Profile ProfileOf(const Round& round) {
  const Vec2 side(round.radius, round.shoulder_z - round.apex_z);
  return {Vec2(0, round.apex_z), Vec2(round.radius, round.shoulder_z),
          Vec2(round.radius, round.end_z), Vec2(0, round.end_z),
          Vec2(side.y(), -side.x()) / side.norm()};
}

// Of three half-planes the one that a point violates most (or satisfies least).
struct Deepest {
  double value;
  Vec2 normal;
};

Deepest DeepestFace(const Round& round, const Profile& profile, const Vec2& q) {
  Deepest best{profile.cone_normal.dot(q - profile.apex), profile.cone_normal};
  if (q.x() - round.radius > best.value) best = {q.x() - round.radius, Vec2(1, 0)};
  if (q.y() - round.end_z > best.value) best = {q.y() - round.end_z, Vec2(0, 1)};
  return best;
}

Vec2 NearestOnSegment(const Vec2& a, const Vec2& b, const Vec2& q) {
  const Vec2 along = b - a;
  const double length_sq = along.squaredNorm();
  if (length_sq == 0) return a;
  return a + std::clamp(along.dot(q - a) / length_sq, 0.0, 1.0) * along;
}

Vec2 NearestOnProfile(const Profile& profile, const Vec2& q) {
  Vec2 best = NearestOnSegment(profile.apex, profile.shoulder, q);
  for (const Vec2& candidate : {NearestOnSegment(profile.shoulder, profile.rim, q),
                                NearestOnSegment(profile.rim, profile.end, q)}) {
    if ((candidate - q).squaredNorm() < (best - q).squaredNorm()) best = candidate;
  }
  return best;
}

// The distance at a point of the half-plane and its gradient there, unit.
struct ProfileValue {
  double distance;
  Vec2 gradient;
};

ProfileValue ValueAt(const Round& round, const Profile& profile, const Vec2& q) {
  const Deepest face = DeepestFace(round, profile, q);
  if (face.value <= 0) return {face.value, face.normal};
  const Vec2 outwards = q - NearestOnProfile(profile, q);
  const double length = outwards.norm();
  // Below this the direction is round-off; the face's own normal is right to the same accuracy.
  if (length <= 1e-9 * round.radius) return {length, face.normal};
  return {length, outwards / length};
}

// A triangle cut into segments of constant z, one for each t in [0, 1] from its lowest corner to
// its highest.
//
// On such a segment the signed distance is least where rho is least, a closed form; the least over
// t is the minimum of a convex function of one variable. For a triangle of constant z any cut into
// parallel segments serves as well.
class Slices {
 public:
  explicit Slices(const TriangleCorners& corners) : corners_(corners), order_{0, 1, 2} {
    // Three elements: a sorting network, so that equal heights keep their order.
    if (corners[order_[1]].z() < corners[order_[0]].z()) std::swap(order_[0], order_[1]);
    if (corners[order_[2]].z() < corners[order_[1]].z()) std::swap(order_[1], order_[2]);
    if (corners[order_[1]].z() < corners[order_[0]].z()) std::swap(order_[0], order_[1]);
    rise_ = high().z() - low().z();
    middle_ = rise_ > 0 ? (mid().z() - low().z()) / rise_ : 0.5;
  }

  double middle() const { return middle_; }

  // The t at which the slice has height z, in [0, 1]; `flat` where all slices have the same.
  double ParameterAt(double z, double flat) const {
    return rise_ > 0 ? std::clamp((z - low().z()) / rise_, 0.0, 1.0) : flat;
  }

  struct Point {
    double rho;
    double z;
    double t;
    double rho_rate;                             // change of rho with t
    double on_long, on_short_mid, on_short_end;  // weights of the corners: see Weights()
  };

  double rise() const { return rise_; }

  // The point of slice t nearest to the axis.
  Point Nearest(double t) const {
    const Vec3 p = low() + t * (high() - low());
    const bool lower = t < middle_ || middle_ == 1;
    // The other end is on low-mid below the middle corner, on mid-high above it.
    const double s = lower ? t / middle_ : (t - middle_) / (1 - middle_);
    const Vec3& start = lower ? low() : mid();
    const Vec3 side = lower ? Vec3(mid() - low()) : Vec3(high() - mid());
    const Vec3 q = start + s * side;
    const double dx = q.x() - p.x(), dy = q.y() - p.y();
    const double length_sq = dx * dx + dy * dy;
    const double u =
        length_sq > 0 ? std::clamp(-(p.x() * dx + p.y() * dy) / length_sq, 0.0, 1.0) : 0;
    const double x = p.x() + u * dx, y = p.y() + u * dy;
    Point point;
    point.rho = std::sqrt(x * x + y * y);
    point.z = p.z() + u * (q.z() - p.z());
    point.t = t;
    // u is where rho is least on the slice, so that its own change does not count (envelope
    // theorem). At a corner the slice is a point and every u is; the steepest way into the triangle
    // counts.
    const Vec3 long_rate = high() - low(), side_rate = side / (lower ? middle_ : 1 - middle_);
    const auto rho_rate = [&](double share) {
      const Vec3 rate = (1 - share) * long_rate + share * side_rate;
      return point.rho > 0 ? (x * rate.x() + y * rate.y()) / point.rho : 0;
    };
    const bool corner = (t == 0 && middle_ > 0) || (t == 1 && middle_ < 1);
    if (!corner) {
      point.rho_rate = rho_rate(u);
    } else {
      point.rho_rate =
          t < 0.5 ? std::min(rho_rate(0), rho_rate(1)) : std::max(rho_rate(0), rho_rate(1));
    }
    point.on_long = 1 - u;
    point.on_short_mid = u * (lower ? s : 1 - s);
    point.on_short_end = u * (lower ? 1 - s : s);
    return point;
  }

  Vec3 Weights(const Point& point) const {
    const bool lower = point.t < middle_ || middle_ == 1;
    Vec3 weights;
    weights[order_[0]] = point.on_long * (1 - point.t) + (lower ? point.on_short_end : 0);
    weights[order_[1]] = point.on_short_mid;
    weights[order_[2]] = point.on_long * point.t + (lower ? 0 : point.on_short_end);
    return weights;
  }

 private:
  const Vec3& low() const { return corners_[order_[0]]; }
  const Vec3& mid() const { return corners_[order_[1]]; }
  const Vec3& high() const { return corners_[order_[2]]; }

  const TriangleCorners& corners_;
  std::array<int, 3> order_;
  double rise_;
  double middle_;
};

// The distance at the best point of a slice, and its change with t.
struct Sample {
  Slices::Point point;
  double distance;
  double slope;
  Vec2 gradient;
};

// The least of a convex function between two samples by its tangents. Where the two meet bounds it
// from below, which ends the search; the next sample is taken there (exact for a corner), where the
// secant of the slopes is zero (exact for a parabola), or halfway (always half), in turn.
template <typename Evaluate>
Sample Minimum(Sample low, Sample high, double within_m, const Evaluate& evaluate) {
  constexpr double kTolerance_m = 1e-15;  // of the distance: round-off of lengths of some metres
  constexpr int kMaxRounds = 150;
  Sample best = high.distance < low.distance ? high : low;
  for (int round = 0; round < kMaxRounds; ++round) {
    if (low.slope >= 0) return low.distance <= best.distance ? low : best;
    if (high.slope <= 0) return high.distance <= best.distance ? high : best;
    const double span = high.point.t - low.point.t;
    const double meet = std::clamp(
        (high.distance - low.distance - high.slope * span) / (low.slope - high.slope), 0.0, span);
    const double bound = low.distance + low.slope * meet;
    if (best.distance - bound <= kTolerance_m || bound > within_m) return best;
    const double secant = -low.slope * span / (high.slope - low.slope);
    const double step = round % 3 == 0 ? meet : (round % 3 == 1 ? secant : 0.5 * span);
    const double t = low.point.t + step;
    if (t <= low.point.t || t >= high.point.t) {
      if (round % 3 == 2) return best;  // nothing lies between them
      continue;
    }
    const Sample next = evaluate(t);
    if (next.distance < best.distance) best = next;
    (next.slope < 0 ? low : high) = next;
  }
  return best;
}

}  // namespace

double ProfileDistance(const Round& round, double rho, double z) {
  return ValueAt(round, ProfileOf(round), Vec2(rho, z)).distance;
}

Vec3 ContactNormal(const TriangleCorners& corners, const Vec3& weights, const Vec3& gradient) {
  const Vec3 ab = corners[1] - corners[0], ac = corners[2] - corners[0];
  const Vec3 cross = ab.cross(ac);
  const double area = cross.norm();
  // Interior of a triangle that has a normal; the factors only have to be well above round-off.
  if (weights.minCoeff() > 1e-9 && area > 1e-9 * ab.norm() * ac.norm()) {
    const Vec3 normal = cross / area;
    double side = normal.dot(gradient);
    // A triangle right across the tool (side is round-off): ahead of the tip.
    if (std::abs(side) < 1e-9) side = -normal.z();
    return side < 0 ? Vec3(-normal) : normal;
  }
  const double length = gradient.norm();
  return length > 0 ? Vec3(gradient / length) : Vec3(-Vec3::UnitZ());
}

bool NearestToRound(const Round& round, const TriangleCorners& corners, double within_m,
                    SolidNearest* nearest) {
  const Profile profile = ProfileOf(round);
  const Slices slices(corners);
  const auto evaluate = [&](double t) {
    const Slices::Point point = slices.Nearest(t);
    const ProfileValue value = ValueAt(round, profile, Vec2(point.rho, point.z));
    const double slope = value.gradient.x() * point.rho_rate + value.gradient.y() * slices.rise();
    return Sample{point, value.distance, slope, value.gradient};
  };
  // Only slices that can be near enough matter; this also keeps the search sharp on triangles much
  // larger than a tool.
  Sample low = evaluate(slices.ParameterAt(round.apex_z - within_m, 0));
  Sample high = evaluate(slices.ParameterAt(round.end_z + within_m, 1));
  if (slices.middle() > low.point.t && slices.middle() < high.point.t) {
    const Sample middle = evaluate(slices.middle());
    (middle.slope < 0 ? low : high) = middle;
  }
  const Sample best = Minimum(low, high, within_m, evaluate);
  if (!(best.distance <= within_m)) return false;
  nearest->distance_m = best.distance;
  nearest->weights = slices.Weights(best.point);
  nearest->point_m = nearest->weights[0] * corners[0] + nearest->weights[1] * corners[1] +
                     nearest->weights[2] * corners[2];
  const double rho = best.point.rho;
  const Vec3& p = nearest->point_m;
  const Vec3 outwards =
      rho > 1e-9 * round.radius ? Vec3(p.x() / rho, p.y() / rho, 0) : Vec3::Zero();
  nearest->normal = ContactNormal(corners, nearest->weights,
                                  best.gradient.x() * outwards + best.gradient.y() * Vec3::UnitZ());
  return true;
}

}  // namespace adhesim
