#include "core/contact/detector.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace adhesim {
namespace {

constexpr int kGrain = 256;  // groups: about 50 us of work
constexpr double kSkin =
    1.5;  // of the reach: a larger one is renewed less often and holds more to look at
constexpr int kCandidatesPerParticle = 64;
constexpr int kGroupsPerParticle = 8;

// Angle between two vectors, good to 1e-3 rad, by arithmetic alone (pseudonormals need weights, not
// exact angles).
double Angle(const Vec3& u, const Vec3& v) {
  const double denominator = std::sqrt(u.squaredNorm() * v.squaredNorm()) + u.dot(v);
  const double t = u.cross(v).norm();
  if (!(denominator > 0)) return M_PI;
  // 2 atan(t / denominator); atan(x) = pi/4 x + 0.273 x (1 - x) on [0, 1].
  const bool steep = t > denominator;
  const double x = steep ? denominator / t : t / denominator;
  const double atan = M_PI_4 * x + 0.273 * x * (1 - x);
  return 2 * (steep ? M_PI_2 - atan : atan);
}

const NearPair kNone{-1, -1, -1, Vec3::Zero(), Vec3::Zero(), 0, 1};

bool IsBehind(const Vec3& p, const Triangle& tri, std::span<const Vec3> position_m) {
  const Vec3& a = position_m[tri[0]];
  return (position_m[tri[1]] - a).cross(position_m[tri[2]] - a).dot(p - a) <= 0;
}

}  // namespace

Detector::Detector(const Model& model, double reach_m, const Options& options)
    : model_(model),
      reach_m_(reach_m),
      skin_m_(kSkin * reach_m),
      bodies_(model, reach_m, kSkin * reach_m, options.self_apart_m.has_value()),
      box_(model.bodies.size()),
      velocity_box_(model.bodies.size()),
      groups_(kGroupsPerParticle * model.rest_position_m.size() + 64),
      candidates_(kCandidatesPerParticle * model.rest_position_m.size() + 4096) {
  across_.assign(model.triangles.size(), {-1, -1, -1});
  std::map<std::pair<int, int>, std::pair<int, int>> half_edges;
  for (int t = 0; t < static_cast<int>(model.triangles.size()); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int u = model.triangles[t][k], v = model.triangles[t][(k + 1) % 3];
      if (const auto it = half_edges.find({v, u}); it != half_edges.end()) {
        across_[t][k] = it->second.first;
        across_[it->second.first][it->second.second] = t;
      }
      half_edges[{u, v}] = {t, k};
    }
  }

  work_.reserve(kGroupsPerParticle * model.rest_position_m.size() + 64);
  evaluated_.reserve(work_.capacity());
  near_.reserve(work_.capacity());
  if (options.self_apart_m) {
    rest_ = std::make_unique<RestNeighbours>(model, *options.self_apart_m);
  }
  if (options.edges) edge_pairs_ = std::make_unique<EdgePairs>(model, reach_m_ + skin_m_);
}

void Detector::Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report) {
  bodies_.Update(position_m, parallel, report);
  if (bodies_.any_stale()) Renew(position_m, parallel->simd(), report);
}

double Detector::ClosingSpeed(std::span<const Vec3> position_m, std::span<const Vec3> velocity_m_s,
                              double enough_m_s) {
  for (std::size_t b = 0; b < box_.size(); ++b) {
    const Body& body = model_.bodies[b];
    if (sleep_ && sleep_->Of(static_cast<int>(b))) {
      box_[b] = sleep_->box_m[b];
      velocity_box_[b] = {Vec3::Zero(), Vec3::Zero()};
      continue;
    }
    box_[b] = velocity_box_[b] = Aabb{};
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      box_[b].Add(position_m[p]);
      velocity_box_[b].Add(velocity_m_s[p]);
    }
  }
  const auto closing_sq = [](const Aabb& a, const Aabb& b) {
    return (a.max - b.min).cwiseMax(b.max - a.min).squaredNorm();
  };
  // Of the triangles of one body that are near the other's box; a point of a triangle is no faster
  // than its corners. The trees name more than that, depending on what they were fitted to: the
  // boxes of now decide.
  const auto velocities = [&](int body, const Aabb& near) {
    Aabb found;
    bodies_.Query(body, near, [&](int t) {
      const Triangle& tri = model_.triangles[t];
      Aabb box;
      for (int p : tri) box.Add(position_m[p]);
      if (!box.Overlaps(near)) return;
      for (int p : tri) found.Add(velocity_m_s[p]);
    });
    return found;
  };
  double fastest_sq = enough_m_s * enough_m_s;
  for (const BodyPair& pair : bodies_.pairs()) {
    const int a = pair.body, b = pair.other;
    if (a >= b || closing_sq(velocity_box_[a], velocity_box_[b]) <= fastest_sq) continue;
    const Aabb of_a = velocities(a, box_[b].Grown(reach_m_));
    const Aabb of_b = velocities(b, box_[a].Grown(reach_m_));
    if (!(of_a.min.x() <= of_a.max.x()) || !(of_b.min.x() <= of_b.max.x())) continue;  // empty
    fastest_sq = std::max(fastest_sq, closing_sq(of_a, of_b));
  }
  return std::sqrt(fastest_sq);
}

void Detector::Renew(std::span<const Vec3> position_m, Simd simd, StepReport* report) {
  if (groups_.crowded() || candidates_.crowded() || (edge_pairs_ && edge_pairs_->crowded())) {
    CopyLists();
  }
  for (BodyPair& pair : bodies_.pairs()) {
    if (!pair.stale) continue;
    if (!List(&pair, position_m, simd)) {
      CopyLists();  // nobody refers to a stale pair's lists
      if (!List(&pair, position_m, simd)) report->bits |= kStepCandidateCapacity;
    }
    pair.stale = false;
  }
}

void Detector::CopyLists() {
  groups_.BeginCopy();
  candidates_.BeginCopy();
  if (edge_pairs_) edge_pairs_->BeginCopy();
  for (BodyPair& pair : bodies_.pairs()) {
    if (pair.stale) {
      pair.groups = pair.candidates = pair.edges = {};
      continue;
    }
    groups_.Keep(&pair.groups);
    candidates_.Keep(&pair.candidates);
    if (edge_pairs_) edge_pairs_->Keep(&pair.edges);
  }
  groups_.EndCopy();
  candidates_.EndCopy();
  if (edge_pairs_) edge_pairs_->EndCopy();
}

// Lists particles and edges of pair->body near those of pair->other. False when there is no room
// for all.
bool Detector::List(BodyPair* pair, std::span<const Vec3> position_m, Simd simd) {
  const double within = reach_m_ + skin_m_;
  const bool own = pair->body == pair->other;
  const Aabb box = bodies_.BoxNow(pair->other).Grown(within);
  const std::span<const NearbyParticle> region = bodies_.region(*pair);
  Aabb near_box;
  for (const NearbyParticle& near : region) {
    if (box.Contains(near.listed_m)) near_box.Add(near.listed_m);
  }
  boxes_.Clear();
  bool few = true;
  bodies_.Query(pair->other, near_box.Grown(within), [&](int t) {
    Aabb around;
    for (int p : model_.triangles[t]) around.Add(position_m[p]);
    few = few && boxes_.Push(t, around);
  });
  groups_.Begin();
  candidates_.Begin();
  bool room = true;
  for (const NearbyParticle& near : region) {
    if (!room || !box.Contains(near.listed_m)) continue;
    const Aabb around = Aabb{near.listed_m, near.listed_m}.Grown(within);
    room = few ? ListGroup(near.particle, own, position_m,
                           [&](const auto& visit) { boxes_.Query(simd, around, visit); })
               : ListGroup(near.particle, own, position_m,
                           [&](const auto& visit) { bodies_.Query(pair->other, around, visit); });
  }
  pair->groups = groups_.End();
  pair->candidates = candidates_.End();
  pair->nearest_m = std::numeric_limits<double>::infinity();
  for (const Group& group : groups_[pair->groups]) {
    pair->nearest_m = std::min<double>(pair->nearest_m, group.distance_m);
  }
  if (edge_pairs_ && pair->body <= pair->other) {
    RestNeighbours* rest = pair->body == pair->other ? rest_.get() : nullptr;
    room &= edge_pairs_->List(pair, bodies_, rest, position_m, simd);
  }
  return room;
}

// The triangles near particle `p`, of those that query(visit) names; of its own body if `own`.
template <typename Query>
bool Detector::ListGroup(int p, bool own, std::span<const Vec3> position_m, const Query& query) {
  const Vec3& x = position_m[p];
  const double within = reach_m_ + skin_m_;
  const int first = candidates_.End().count;
  bool room = true;
  if (own) rest_->Of(p);
  query([&](int t) {
    const Triangle& tri = model_.triangles[t];
    const double distance_sq =
        ClosestPointOnTriangle(x, position_m[tri[0]], position_m[tri[1]], position_m[tri[2]])
            .distance_sq_m2;
    if (distance_sq > within * within || (own && BelongTogether(p, t))) return;
    room = room && candidates_.Push({t, NoMoreThan(std::sqrt(distance_sq))});
  });
  const int count = candidates_.End().count - first;
  if (count == 0) return room;
  const std::span<Candidate> found = candidates_[candidates_.End()].subspan(first, count);
  std::sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) {
    return a.distance_m != b.distance_m ? a.distance_m < b.distance_m : a.triangle < b.triangle;
  });
  return groups_.Push({p, first, count, found[0].distance_m}) && room;
}

// Whether the particle that `rest_` is asked about and a triangle of its body never collide.
bool Detector::BelongTogether(int particle, int triangle) const {
  if (rest_->IncludeTriangle(triangle)) return true;
  const std::vector<Vec3>& rest = model_.rest_position_m;
  const Triangle& tri = model_.triangles[triangle];
  return rest_->TooNearAtRest(
      ClosestPointOnTriangle(rest[particle], rest[tri[0]], rest[tri[1]], rest[tri[2]])
          .distance_sq_m2);
}

// The groups that may be within reach, ascending by (particle, body).
void Detector::CollectWork() {
  work_.clear();
  std::size_t first = 0;  // of the body's
  int body = -1, parts = 0;
  const auto end_body = [&] {
    if (parts < 2) return;
    std::sort(work_.begin() + first, work_.end(), [](const Work& v, const Work& w) {
      return v.particle != w.particle ? v.particle < w.particle : v.body < w.body;
    });
  };
  for (const BodyPair& pair : bodies_.pairs()) {
    const double nearer_m = bodies_.nearer_m(pair);
    if (pair.nearest_m - nearer_m > reach_m_ || (sleep_ && bodies_.BothStill(pair))) continue;
    if (pair.body != body) {
      end_body();
      body = pair.body;
      first = work_.size();
      parts = 0;
    }
    ++parts;
    for (const Group& group : groups_[pair.groups]) {
      if (group.distance_m - nearer_m > reach_m_) continue;
      work_.push_back({group.particle,
                       pair.other,
                       {pair.candidates.first + group.first, group.count},
                       nearer_m});
    }
  }
  end_body();
}

std::span<const NearPair> Detector::Find(std::span<const Vec3> position_m, Parallel* parallel) {
  CollectWork();
  evaluated_.resize(work_.size());
  parallel->For(static_cast<int>(work_.size()), kGrain, [&](int begin, int end) {
    for (int w = begin; w < end; ++w) evaluated_[w] = Evaluate(work_[w], position_m);
  });
  near_.clear();
  for (const NearPair& pair : evaluated_) {
    if (pair.particle >= 0 && std::abs(pair.gap_m) <= reach_m_) near_.push_back(pair);
  }
  return near_;
}

std::span<const NearEdges> Detector::FindEdges(std::span<const Vec3> position_m,
                                               std::span<const std::int32_t> moves_with,
                                               Parallel* parallel, StepReport* report) {
  if (!edge_pairs_) return {};
  return edge_pairs_->Find(bodies_, position_m, moves_with, reach_m_, parallel, report);
}

NearPair Detector::Evaluate(const Work& group, std::span<const Vec3> position_m) const {
  const Vec3& x = position_m[group.particle];
  ClosestPoint best{Vec3::Zero(), ClosestPoint::kFace, std::numeric_limits<double>::infinity()};
  int triangle = -1;
  const bool closed = model_.bodies[group.body].closed;
  // What a closed body's particle sees of it from inside is its own thickness; that must not hide
  // what it sees from outside.
  const bool from_outside = closed && model_.body_of[group.particle] == group.body;
  for (const Candidate& candidate : candidates_[group.candidates]) {
    // By distance: those that follow were further still.
    const double least_m = candidate.distance_m - group.nearer_m;
    if (least_m > 0 && least_m * least_m > best.distance_sq_m2) break;
    const int t = candidate.triangle;
    const Triangle& tri = model_.triangles[t];
    if (from_outside && IsBehind(x, tri, position_m)) continue;
    const ClosestPoint point =
        ClosestPointOnTriangle(x, position_m[tri[0]], position_m[tri[1]], position_m[tri[2]]);
    if (point.distance_sq_m2 < best.distance_sq_m2 ||
        (point.distance_sq_m2 == best.distance_sq_m2 && t < triangle)) {
      best = point;
      triangle = t;
    }
  }
  if (triangle < 0) return kNone;
  const Triangle& tri = model_.triangles[triangle];
  const Vec3 nearest = best.weights(0) * position_m[tri[0]] + best.weights(1) * position_m[tri[1]] +
                       best.weights(2) * position_m[tri[2]];
  const Vec3 offset = x - nearest;
  const Vec3 outward = Pseudonormal(triangle, best.feature, position_m);
  const double distance = offset.norm();
  const bool outside = offset.dot(outward) >= 0;
  NearPair pair{group.particle, group.body, triangle, best.weights, outward, distance, 1};
  if (from_outside && !outside) return kNone;
  if (closed) {
    if (!outside) pair.gap_m = -distance;
    if (distance > 0) pair.normal = offset / (outside ? distance : -distance);
  } else {
    pair.side = outside ? 1 : -1;
    pair.normal = distance > 0 ? Vec3(offset / distance) : Vec3(outward * pair.side);
  }
  return pair;
}

// The normal whose sign tells inside from outside at the nearest feature: of the face, the sum of
// both faces at an edge, the angle-weighted sum at a corner (Baerentzen and Aanaes 2005).
Vec3 Detector::Pseudonormal(int triangle, ClosestPoint::Feature feature,
                            std::span<const Vec3> position_m) const {
  const auto face_normal = [&](int t) -> Vec3 {
    const Triangle& tri = model_.triangles[t];
    const Vec3 a = position_m[tri[0]];
    const Vec3 n = (position_m[tri[1]] - a).cross(position_m[tri[2]] - a);
    const double length = n.norm();
    return length > 0 ? Vec3(n / length) : Vec3::Zero();
  };
  Vec3 sum = Vec3::Zero();
  if (feature >= ClosestPoint::kCorner0) {
    const int corner = model_.triangles[triangle][feature - ClosestPoint::kCorner0];
    for (int k = model_.incident_start[corner]; k < model_.incident_start[corner + 1]; ++k) {
      const int t = model_.incident[k];
      const Triangle& tri = model_.triangles[t];
      const int at = tri[0] == corner ? 0 : tri[1] == corner ? 1 : 2;
      const Vec3 u = position_m[tri[(at + 1) % 3]] - position_m[corner];
      const Vec3 v = position_m[tri[(at + 2) % 3]] - position_m[corner];
      sum += Angle(u, v) * face_normal(t);
    }
  } else {
    sum = face_normal(triangle);
    if (feature != ClosestPoint::kFace) {
      const int other = across_[triangle][feature - ClosestPoint::kEdge0];
      if (other >= 0) sum += face_normal(other);
    }
  }
  const double length = sum.norm();
  return length > 0 ? Vec3(sum / length) : Vec3::UnitZ();
}

}  // namespace adhesim
