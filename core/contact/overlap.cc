#include "core/contact/overlap.h"

#include <algorithm>
#include <cmath>

#include "core/contact/penetration.h"
#include "core/model/carried.h"
#include "core/model/closest_point.h"

namespace adhesim {
namespace {

constexpr double kShare = 0.1;   // of the depth, in one step
constexpr double kLeast = 0.1;   // of the limit: the last bit does not take for ever
constexpr double kDeep = 4;      // limits: from here on bodies move as wholes
constexpr double kOneWay = 0.2;  // of a sum of unit vectors: less has no direction of its own
constexpr double kInner = 1e-6;  // of a body's size

Aabb BoxOf(const Body& body, std::span<const Vec3> position_m) {
  Aabb box;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p)
    box.Add(position_m[p]);
  return box;
}

// Where the segment from `inside` to `outside` leaves through the triangle: its share of the way,
// or a negative number.
double Pierces(const Vec3& inside, const Vec3& outside, const Vec3& a, const Vec3& b,
               const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  const Vec3 way = outside - inside;
  const double along = way.dot(n);
  if (!(along > 0)) return -1;  // it has to go out
  const double t = (a - inside).dot(n) / along;
  if (!(t >= 0 && t <= 1)) return -1;
  const Vec3 x = inside + t * way;
  const bool in_all = (b - a).cross(x - a).dot(n) >= 0 && (c - b).cross(x - b).dot(n) >= 0 &&
                      (a - c).cross(x - c).dot(n) >= 0;
  return in_all ? t : -1;
}

}  // namespace

Overlap::Overlap(const Model& model) : model_(model), carried_(model) {
  const std::size_t n = model.rest_position_m.size();
  inside_.reserve(2 * n);
  pair_.reserve(2 * n);
  layer_.reserve(2 * n);
  at_.assign(n, -1);
  box_.resize(model.bodies.size());
  involved_.resize(model.bodies.size());
  body_mass_kg_.assign(model.bodies.size(), 0);
  held_.assign(model.bodies.size(), 0);
  for (std::size_t p = 0; p < n; ++p) {
    const int b = model.body_of[p];
    body_mass_kg_[b] += model.mass_kg[p];
    // Where one particle may not move, the body cannot be pushed along as a whole.
    if (model.fixed[p]) held_[b] = 1;
  }
}

std::span<const Overlap::Inside> Overlap::Find(std::span<const Vec3> position_m) {
  inside_.clear();
  for (std::size_t b = 0; b < box_.size(); ++b) box_[b] = BoxOf(model_.bodies[b], position_m);
  for (int b = 0; b < static_cast<int>(model_.bodies.size()); ++b) {
    if (model_.bodies[b].closed) FindIn(b, position_m);
  }
  std::sort(inside_.begin(), inside_.end(), [](const Inside& a, const Inside& b) {
    return a.particle != b.particle ? a.particle < b.particle : a.body < b.body;
  });
  return inside_;
}

void Overlap::FindIn(int b, std::span<const Vec3> position_m) {
  const Body& body = model_.bodies[b];
  first_ = inside_.size();
  for (std::size_t o = 0; o < model_.bodies.size(); ++o) {
    const Body& other = model_.bodies[o];
    if (&other == &body || (other.all_fixed && body.all_fixed)) continue;
    if (!box_[b].Overlaps(box_[o])) continue;
    for (int p = other.first_particle; p < other.first_particle + other.particle_count; ++p) {
      if (inside_.size() == inside_.capacity()) break;  // the rest in a later step
      if (!model_.OnSurface(p) || !box_[b].Contains(position_m[p]) ||
          (model_.fixed[p] && body.all_fixed) ||
          !IsInside(model_, body, position_m, InnerPoint(p, position_m))) {
        continue;
      }
      at_[p] = static_cast<int>(inside_.size());
      inside_.push_back({p, b, 0, Vec3::Zero()});
    }
  }
  layer_.assign(inside_.size(), 0);
  MeasureBorder(position_m);
  SpreadInward(position_m);
  MeasureTheRest(position_m);
  for (std::size_t i = first_; i < inside_.size(); ++i) at_[inside_[i].particle] = -1;
}

// A little inside its own body: two bodies at the very same place have all particles on each
// other's surface, two that only touch have as well.
Vec3 Overlap::InnerPoint(int p, std::span<const Vec3> position_m) const {
  const Body& body = model_.bodies[model_.body_of[p]];
  if (!body.closed) return position_m[p];
  Vec3 normal = Vec3::Zero();
  for (int k = model_.incident_start[p]; k < model_.incident_start[p + 1]; ++k) {
    const Triangle& tri = model_.triangles[model_.incident[k]];
    normal +=
        (position_m[tri[1]] - position_m[tri[0]]).cross(position_m[tri[2]] - position_m[tri[0]]);
  }
  const double length = normal.norm();
  return length > 0 ? Vec3(position_m[p] - kInner * body.size_m / length * normal) : position_m[p];
}

// Particles with a neighbour outside, by where the edges to those pierce the surface.
void Overlap::MeasureBorder(std::span<const Vec3> position_m) {
  for (std::size_t i = first_; i < inside_.size(); ++i) {
    Inside& at = inside_[i];
    const Body& body = model_.bodies[at.body];
    const Vec3& x = position_m[at.particle];
    double depth = 0, weights = 0;
    Vec3 direction = Vec3::Zero();
    for (int k = model_.neighbour_start[at.particle]; k < model_.neighbour_start[at.particle + 1];
         ++k) {
      const int q = model_.neighbours[k];
      if (at_[q] >= 0) continue;
      for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
        const Triangle& tri = model_.triangles[t];
        const Vec3 &a = position_m[tri[0]], &b = position_m[tri[1]], &c = position_m[tri[2]];
        const double share = Pierces(x, position_m[q], a, b, c);
        if (share < 0) continue;
        const Vec3 way = share * (position_m[q] - x);
        const Vec3 normal = (b - a).cross(c - a).normalized();
        // On the surface already: what is there counts alone, nearly.
        const double weight = 1 / std::max(way.squaredNorm(), 1e-12 * body.size_m * body.size_m);
        weights += weight;
        depth += weight * way.dot(normal);
        direction += weight * normal;
      }
    }
    const double length = direction.norm();
    if (!(length > 0)) continue;
    at.depth_m = depth / weights;
    at.direction = direction / length;
    layer_[i] = 1;
  }
}

// The others, layer by layer, from neighbours that have been measured.
void Overlap::SpreadInward(std::span<const Vec3> position_m) {
  for (bool spread = true; spread;) {
    spread = false;
    for (std::size_t i = first_; i < inside_.size(); ++i) {
      if (layer_[i] != 0) continue;
      Inside& at = inside_[i];
      double depth = 0, weights = 0;
      Vec3 direction = Vec3::Zero();
      for (int k = model_.neighbour_start[at.particle]; k < model_.neighbour_start[at.particle + 1];
           ++k) {
        const int j = at_[model_.neighbours[k]];
        if (j < 0 || layer_[j] != 1) continue;
        const Vec3 way = position_m[inside_[j].particle] - position_m[at.particle];
        const double weight = 1 / way.squaredNorm();
        weights += weight;
        depth += weight * (way.dot(inside_[j].direction) + inside_[j].depth_m);
        direction += weight * inside_[j].direction;
      }
      const double length = direction.norm();
      if (!(length > 0)) continue;
      at.depth_m = depth / weights;
      at.direction = direction / length;
      layer_[i] = 2;
      spread = true;
    }
    for (std::size_t i = first_; i < inside_.size(); ++i) layer_[i] = layer_[i] != 0;
  }
}

// A body, or a part of one, that is inside as a whole: through the nearest point of the surface to
// its middle, all of it the same way.
void Overlap::MeasureTheRest(std::span<const Vec3> position_m) {
  for (std::size_t i = first_; i < inside_.size(); ++i) {
    Inside& at = inside_[i];
    if (layer_[i] != 0) continue;
    const Body& body = model_.bodies[at.body];
    const Aabb& box = box_[model_.body_of[at.particle]];
    const Vec3 middle = 0.5 * (box.min + box.max);
    double nearest_sq = std::numeric_limits<double>::infinity();
    Vec3 out = Vec3::UnitZ();
    for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
      const Triangle& tri = model_.triangles[t];
      const Vec3 &a = position_m[tri[0]], &b = position_m[tri[1]], &c = position_m[tri[2]];
      const ClosestPoint point = ClosestPointOnTriangle(middle, a, b, c);
      if (point.distance_sq_m2 >= nearest_sq) continue;
      nearest_sq = point.distance_sq_m2;
      out = (b - a).cross(c - a).normalized();
    }
    at.direction = out;
    at.depth_m = std::sqrt(nearest_sq) + 0.5 * (box.max - box.min).norm();
  }
}

// The point of the surface that it leaves by.
Overlap::Exit Overlap::ExitOf(const Inside& at, std::span<const Vec3> position_m) const {
  const Body& body = model_.bodies[at.body];
  const Vec3 target = position_m[at.particle] + at.depth_m * at.direction;
  Exit exit{body.first_triangle, Vec3::Zero()};
  double nearest_sq = std::numeric_limits<double>::infinity();
  for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
    const Triangle& tri = model_.triangles[t];
    const ClosestPoint point =
        ClosestPointOnTriangle(target, position_m[tri[0]], position_m[tri[1]], position_m[tri[2]]);
    if (point.distance_sq_m2 >= nearest_sq) continue;
    nearest_sq = point.distance_sq_m2;
    exit = {t, point.weights};
  }
  return exit;
}

double Overlap::Mobility(int p) const {
  const int b = model_.body_of[p];
  if (model_.fixed[p] || (model_.bodies[b].rigid && held_[b])) return 0;
  if (model_.bodies[b].rigid) return 1 / body_mass_kg_[b];
  const CarriedParticle* c = carried_.Find(p);
  if (!c) return 1 / model_.mass_kg[p];
  double mobility = 0;
  for (int k = 0; k < 4; ++k) mobility += c->weights[k] * c->weights[k] * Mobility(c->carriers[k]);
  return mobility;
}

void Overlap::Move(int p, const Vec3& push, std::span<Vec3> position_m) const {
  if (model_.bodies[model_.body_of[p]].rigid) {
    MoveBody(model_.body_of[p], Mobility(p) * push, position_m);
  } else if (const CarriedParticle* c = carried_.Find(p)) {
    for (int k = 0; k < 4; ++k)
      position_m[c->carriers[k]] += c->weights[k] * Mobility(c->carriers[k]) * push;
  } else {
    position_m[p] += Mobility(p) * push;
  }
}

void Overlap::MoveBody(int b, const Vec3& by, std::span<Vec3> position_m) const {
  const Body& body = model_.bodies[b];
  for (int q = body.first_particle; q < body.first_particle + body.particle_count; ++q)
    position_m[q] += by;
}

Overlap::Pair& Overlap::PairOf(const Inside& at) {
  const auto [first, second] = std::minmax(model_.body_of[at.particle], at.body);
  const Pair key{first, second, Vec3::Zero(), 0, false};
  const auto place = std::lower_bound(pair_.begin(), pair_.end(), key, PairLess);
  if (place != pair_.end() && !PairLess(key, *place)) return *place;
  return *pair_.insert(place, key);
}

void Overlap::MoveWholes(double limit_m, std::span<Vec3> position_m) {
  pair_.clear();
  for (const Inside& at : inside_) {
    Pair& pair = PairOf(at);
    if (at.body == pair.second) {
      pair.apart += at.direction;
    } else {
      pair.apart -= at.direction;
    }
    pair.depth_m = std::max(pair.depth_m, at.depth_m);
  }
  const auto mobility = [&](int b) { return held_[b] ? 0 : 1 / body_mass_kg_[b]; };
  for (Pair& pair : pair_) {
    const double both = mobility(pair.first) + mobility(pair.second);
    pair.whole = pair.depth_m > kDeep * limit_m && both > 0;
    if (!pair.whole) continue;
    // All around, or at the very same place: as their middles lie, or anywhere.
    if (!(pair.apart.norm() > kOneWay)) {
      const Aabb &a = box_[pair.first], &b = box_[pair.second];
      pair.apart = a.min + a.max - b.min - b.max;
    }
    if (!(pair.apart.norm() > kInner * limit_m)) pair.apart = Vec3::UnitZ();
    const Vec3 push = std::min(kShare * pair.depth_m, limit_m) / both * pair.apart.normalized();
    MoveBody(pair.first, mobility(pair.first) * push, position_m);
    MoveBody(pair.second, -mobility(pair.second) * push, position_m);
  }
}

void Overlap::Separate(double limit_m, std::span<Vec3> position_m) {
  MoveWholes(limit_m, position_m);
  std::fill(involved_.begin(), involved_.end(), 0);
  for (const Inside& at : inside_) {
    for (int b : {model_.body_of[at.particle], at.body}) involved_[b] += model_.bodies[b].rigid;
  }
  for (const Inside& at : inside_) {
    if (PairOf(at).whole) continue;
    const Exit exit = ExitOf(at, position_m);
    const Triangle& tri = model_.triangles[exit.triangle];
    double mobility = Mobility(at.particle);
    for (int k = 0; k < 3; ++k) mobility += exit.weights(k) * exit.weights(k) * Mobility(tri[k]);
    if (!(mobility > 0)) continue;
    const double way = std::min(std::max(kShare * at.depth_m, kLeast * limit_m), limit_m);
    // A rigid body gets the mean of what its particles ask for.
    const int times = std::max({1, involved_[model_.body_of[at.particle]], involved_[at.body]});
    const Vec3 push = way / (mobility * times) * at.direction;
    Move(at.particle, push, position_m);
    for (int k = 0; k < 3; ++k) Move(tri[k], -exit.weights(k) * push, position_m);
  }
  Carry(model_, position_m);
}

}  // namespace adhesim
