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

double DistanceAt(const Round& round, const Profile& profile, const Vec2& q) {
  const double inside = DeepestFace(round, profile, q).value;
  if (inside <= 0) return inside;
  return (NearestOnProfile(profile, q) - q).norm();
}

// The gradient of the profile's distance, unit.
Vec2 GradientAt(const Round& round, const Profile& profile, const Vec2& q) {
  const Deepest face = DeepestFace(round, profile, q);
  if (face.value > 0) {
    const Vec2 outwards = q - NearestOnProfile(profile, q);
    const double length = outwards.norm();
    // Below this the direction is round-off; the face's own normal is right to the same accuracy.
    if (length > 1e-9 * round.radius) return outwards / length;
  }
  return face.normal;
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
    double on_long, on_short_mid, on_short_end;  // weights of the corners: see Weights()
  };

  // The point of slice t nearest to the axis.
  Point Nearest(double t) const {
    const Vec3 p = low() + t * (high() - low());
    const bool lower = t < middle_ || middle_ == 1;
    // The other end is on low-mid below the middle corner, on mid-high above it.
    const double s = lower ? t / middle_ : (t - middle_) / (1 - middle_);
    const Vec3 q = lower ? Vec3(low() + s * (mid() - low())) : Vec3(mid() + s * (high() - mid()));
    const double dx = q.x() - p.x(), dy = q.y() - p.y();
    const double length_sq = dx * dx + dy * dy;
    const double u =
        length_sq > 0 ? std::clamp(-(p.x() * dx + p.y() * dy) / length_sq, 0.0, 1.0) : 0;
    const double x = p.x() + u * dx, y = p.y() + u * dy;
    return {std::sqrt(x * x + y * y), p.z() + u * (q.z() - p.z()), t, 1 - u,
            u * (lower ? s : 1 - s),  u * (lower ? 1 - s : s)};
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

}  // namespace

double ProfileDistance(const Round& round, double rho, double z) {
  return DistanceAt(round, ProfileOf(round), Vec2(rho, z));
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
  Slices::Point best{};
  double least = std::numeric_limits<double>::infinity();
  const auto evaluate = [&](double t) {
    const Slices::Point point = slices.Nearest(t);
    const double distance = DistanceAt(round, profile, Vec2(point.rho, point.z));
    if (distance < least) {
      least = distance;
      best = point;
    }
    return distance;
  };
  // Only slices that can be near enough matter; this also keeps the search sharp on triangles much
  // larger than a tool.
  double from = slices.ParameterAt(round.apex_z - within_m, 0);
  double to = slices.ParameterAt(round.end_z + within_m, 1);
  evaluate(from);
  evaluate(to);
  if (slices.middle() > from && slices.middle() < to) evaluate(slices.middle());
  // Golden section: 44 steps leave 6e-10 of the range.
  constexpr double kGolden = 0.6180339887498949;
  constexpr int kSteps = 44;
  double t1 = to - kGolden * (to - from), t2 = from + kGolden * (to - from);
  double d1 = evaluate(t1), d2 = evaluate(t2);
  for (int step = 0; step < kSteps; ++step) {
    if (d1 <= d2) {
      to = t2;
      t2 = t1;
      d2 = d1;
      t1 = to - kGolden * (to - from);
      d1 = evaluate(t1);
    } else {
      from = t1;
      t1 = t2;
      d1 = d2;
      t2 = from + kGolden * (to - from);
      d2 = evaluate(t2);
    }
  }
  if (!(least <= within_m)) return false;
  nearest->distance_m = least;
  nearest->weights = slices.Weights(best);
  nearest->point_m = nearest->weights[0] * corners[0] + nearest->weights[1] * corners[1] +
                     nearest->weights[2] * corners[2];
  const Vec2 slope = GradientAt(round, profile, Vec2(best.rho, best.z));
  const Vec3& p = nearest->point_m;
  const Vec3 outwards =
      best.rho > 1e-9 * round.radius ? Vec3(p.x() / best.rho, p.y() / best.rho, 0) : Vec3::Zero();
  nearest->normal =
      ContactNormal(corners, nearest->weights, slope.x() * outwards + slope.y() * Vec3::UnitZ());
  return true;
}

}  // namespace adhesim
