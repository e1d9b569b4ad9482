#include "core/contact/detector.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/box.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace adhesim {
namespace {

constexpr int kGrain = 256;         // groups: about 50 us of work
constexpr double kRoundOff = 1e-9;  // of the reach: where distances are compared with old ones
constexpr int kCandidatesPerParticle = 64;

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

struct Detector::Broad {
  fcl::DynamicAABBTreeCollisionManagerd manager;
  std::vector<std::shared_ptr<fcl::Boxd>> boxes;
  std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects;
  std::vector<std::pair<int, int>> pairs;  // bodies whose boxes overlap, first < second, ascending
};

Detector::Detector(const Model& model, double reach_m, const Options& options)
    : model_(model), reach_m_(reach_m), skin_m_(2 * reach_m), broad_(std::make_unique<Broad>()) {
  for (const Body& body : model.bodies) trees_.emplace_back(model, body);

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

  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    broad_->boxes.push_back(std::make_shared<fcl::Boxd>(1, 1, 1));
    broad_->objects.push_back(std::make_unique<fcl::CollisionObjectd>(broad_->boxes.back()));
    broad_->objects.back()->setUserData(reinterpret_cast<void*>(b));
    broad_->manager.registerObject(broad_->objects.back().get());
  }
  broad_->manager.setup();
  broad_->pairs.reserve(16 * model.bodies.size() + 64);
  groups_.reserve(8 * model.rest_position_m.size() + 64);
  candidate_.reserve(kCandidatesPerParticle * model.rest_position_m.size() + 4096);
  evaluated_.reserve(groups_.capacity());
  near_.reserve(groups_.capacity());
  listed_position_m_.reserve(model.rest_position_m.size());
  box_.resize(model.bodies.size());
  velocity_box_.resize(model.bodies.size());
  motion_.resize(model.bodies.size());
  if (options.self_apart_m) {
    rest_ = std::make_unique<RestNeighbours>(model, *options.self_apart_m);
  }
  if (options.edges) edge_pairs_ = std::make_unique<EdgePairs>(model, reach_m_ + skin_m_);
}

Detector::~Detector() = default;

void Detector::Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report) {
  if (!listed_position_m_.empty()) {
    double moved_sq = 0;
    for (std::size_t p = 0; p < position_m.size(); ++p) {
      moved_sq = std::max(moved_sq, (position_m[p] - listed_position_m_[p]).squaredNorm());
    }
    if (moved_sq <= 0.25 * skin_m_ * skin_m_) {
      MeasureMotions(position_m);
      return;
    }
  }
  Rebuild(position_m, report);
}

// How each body has moved since the list was made: what two that move together have in common does
// not bring them nearer.
void Detector::MeasureMotions(std::span<const Vec3> position_m) {
  for (std::size_t b = 0; b < motion_.size(); ++b) {
    const Body& body = model_.bodies[b];
    const int end = body.first_particle + body.particle_count;
    BodyMotion motion;
    for (int p = body.first_particle; p < end; ++p)
      motion.mean_m += position_m[p] - listed_position_m_[p];
    motion.mean_m /= body.particle_count;
    double most_sq = 0;
    for (int p = body.first_particle; p < end; ++p) {
      most_sq =
          std::max(most_sq, (position_m[p] - listed_position_m_[p] - motion.mean_m).squaredNorm());
    }
    motion.rest_m = std::sqrt(most_sq) + kRoundOff * reach_m_;
    motion_[b] = motion;
  }
}

double Detector::ClosingSpeed(std::span<const Vec3> position_m, std::span<const Vec3> velocity_m_s,
                              double enough_m_s) {
  for (std::size_t b = 0; b < box_.size(); ++b) {
    const Body& body = model_.bodies[b];
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
  // than its corners. The trees name more than that, depending on when their list was made: the
  // boxes of now decide.
  const auto velocities = [&](int body, const Aabb& near) {
    Aabb found;
    trees_[body].Query(near, [&](int t) {
      const Triangle& tri = model_.triangles[t];
      Aabb box;
      for (int p : tri) box.Add(position_m[p]);
      if (!box.Overlaps(near)) return;
      for (int p : tri) found.Add(velocity_m_s[p]);
    });
    return found;
  };
  double fastest_sq = enough_m_s * enough_m_s;
  for (const auto& [a, b] : broad_->pairs) {
    if (closing_sq(velocity_box_[a], velocity_box_[b]) <= fastest_sq) continue;
    const Aabb of_a = velocities(a, box_[b].Grown(reach_m_));
    const Aabb of_b = velocities(b, box_[a].Grown(reach_m_));
    if (!(of_a.min.x() <= of_a.max.x()) || !(of_b.min.x() <= of_b.max.x())) continue;  // empty
    fastest_sq = std::max(fastest_sq, closing_sq(of_a, of_b));
  }
  return std::sqrt(fastest_sq);
}

void Detector::Rebuild(std::span<const Vec3> position_m, StepReport* report) {
  listed_position_m_.assign(position_m.begin(), position_m.end());
  std::fill(motion_.begin(), motion_.end(), BodyMotion{Vec3::Zero(), kRoundOff * reach_m_});
  groups_.clear();
  candidate_.clear();
  // Trees and boxes grown by half the skin hold until the list is renewed.
  const double half = 0.5 * (reach_m_ + skin_m_);
  for (std::size_t b = 0; b < trees_.size(); ++b) {
    trees_[b].Refit(position_m, 0.5 * skin_m_);
    const Aabb box = trees_[b].bounds().Grown(half);
    fcl::CollisionObjectd& object = *broad_->objects[b];
    broad_->boxes[b]->side = box.max - box.min;
    broad_->boxes[b]->computeLocalAABB();
    object.setTranslation(0.5 * (box.min + box.max));
    object.computeAABB();
  }
  broad_->manager.update();
  broad_->pairs.clear();
  broad_->manager.collide(
      broad_.get(), [](fcl::CollisionObjectd* first, fcl::CollisionObjectd* second, void* data) {
        Broad& broad = *static_cast<Broad*>(data);
        const int a = static_cast<int>(reinterpret_cast<std::intptr_t>(first->getUserData()));
        const int b = static_cast<int>(reinterpret_cast<std::intptr_t>(second->getUserData()));
        if (broad.pairs.size() < broad.pairs.capacity())
          broad.pairs.emplace_back(std::min(a, b), std::max(a, b));
        return false;
      });
  if (broad_->pairs.size() == broad_->pairs.capacity()) report->bits |= kStepCandidateCapacity;
  std::sort(broad_->pairs.begin(), broad_->pairs.end());
  if (edge_pairs_) edge_pairs_->Begin();
  for (const auto& [a, b] : broad_->pairs) {
    if (model_.bodies[a].all_fixed && model_.bodies[b].all_fixed) continue;
    AddGroups(a, b, position_m, report);
    AddGroups(b, a, position_m, report);
    if (edge_pairs_) edge_pairs_->AddBodies(a, b, trees_[b], position_m, report);
  }
  for (int b = 0; rest_ && b < static_cast<int>(trees_.size()); ++b) {
    if (model_.bodies[b].rigid || model_.bodies[b].all_fixed) continue;
    AddGroups(b, b, position_m, report);
    if (edge_pairs_) edge_pairs_->AddOwn(b, trees_[b], rest_.get(), position_m, report);
  }
  if (edge_pairs_) edge_pairs_->End();
  std::sort(groups_.begin(), groups_.end(), [](const Group& g, const Group& h) {
    return g.particle != h.particle ? g.particle < h.particle : g.body < h.body;
  });
}

// Particles of body a near triangles of body b; of a itself, those that may collide with it.
void Detector::AddGroups(int a, int b, std::span<const Vec3> position_m, StepReport* report) {
  const Body& body = model_.bodies[a];
  const double within = reach_m_ + skin_m_;
  const Aabb box = trees_[b].bounds().Grown(within);
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    const Vec3& x = position_m[p];
    if (!box.Contains(x)) continue;
    Group group{p, b, static_cast<int>(candidate_.size()), 0, 0};
    double nearest_sq = within * within;
    if (a == b) rest_->Of(p);
    trees_[b].Query(Aabb{x, x}.Grown(within), [&](int t) {
      const Triangle& tri = model_.triangles[t];
      const double distance_sq =
          ClosestPointOnTriangle(x, position_m[tri[0]], position_m[tri[1]], position_m[tri[2]])
              .distance_sq_m2;
      if (distance_sq > within * within || (a == b && BelongTogether(p, t))) return;
      if (candidate_.size() == candidate_.capacity()) {
        report->bits |= kStepCandidateCapacity;
        return;
      }
      candidate_.push_back({t, std::sqrt(distance_sq)});
      nearest_sq = std::min(nearest_sq, distance_sq);
    });
    group.count = static_cast<int>(candidate_.size()) - group.first;
    if (group.count == 0) continue;
    if (groups_.size() == groups_.capacity()) {
      report->bits |= kStepCandidateCapacity;
      return;
    }
    std::sort(candidate_.end() - group.count, candidate_.end(),
              [](const Candidate& a, const Candidate& b) {
                return a.distance_m != b.distance_m ? a.distance_m < b.distance_m
                                                    : a.triangle < b.triangle;
              });
    group.distance_m = std::sqrt(nearest_sq);
    groups_.push_back(group);
  }
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

std::span<const NearPair> Detector::Find(std::span<const Vec3> position_m, Parallel* parallel) {
  evaluated_.resize(groups_.size());
  parallel->For(static_cast<int>(groups_.size()), kGrain, [&](int begin, int end) {
    for (int g = begin; g < end; ++g) {
      const Group& group = groups_[g];
      // The pair cannot have come nearer than by this.
      const BodyMotion& motion = motion_[group.body];
      const double nearer_m =
          motion.rest_m +
          (position_m[group.particle] - listed_position_m_[group.particle] - motion.mean_m).norm();
      evaluated_[g] =
          group.distance_m - nearer_m > reach_m_ ? kNone : Evaluate(group, position_m, nearer_m);
    }
  });
  near_.clear();
  for (const NearPair& pair : evaluated_) {
    if (pair.particle >= 0 && std::abs(pair.gap_m) <= reach_m_) near_.push_back(pair);
  }
  return near_;
}

std::span<const NearEdges> Detector::FindEdges(std::span<const Vec3> position_m, Parallel* parallel,
                                               StepReport* report) {
  if (!edge_pairs_) return {};
  return edge_pairs_->Find(position_m, reach_m_, motion_, parallel, report);
}

NearPair Detector::Evaluate(const Group& group, std::span<const Vec3> position_m,
                            double nearer_m) const {
  const Vec3& x = position_m[group.particle];
  ClosestPoint best{Vec3::Zero(), ClosestPoint::kFace, std::numeric_limits<double>::infinity()};
  int triangle = -1;
  const bool closed = model_.bodies[group.body].closed;
  // What a closed body's particle sees of it from inside is its own thickness; that must not hide
  // what it sees from outside.
  const bool from_outside = closed && model_.body_of[group.particle] == group.body;
  for (int k = group.first; k < group.first + group.count; ++k) {
    // By distance: those that follow were further still.
    const double least_m = candidate_[k].distance_m - nearer_m;
    if (least_m > 0 && least_m * least_m > best.distance_sq_m2) break;
    const int t = candidate_[k].triangle;
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
