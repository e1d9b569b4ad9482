#include "core/contact/body_pairs.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/box.h>

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

constexpr double kRoundOff = 1e-9;  // of the reach: where distances are compared with old ones
constexpr double kReferenceShare =
    0.25;                   // of the skin: both of two may use that up, and half is left
constexpr int kGrain = 64;  // bodies: 40 particles each are about 20 us of work
constexpr int kPairsPerBody = 32;

}  // namespace

struct BodyPairs::Broad {
  fcl::DynamicAABBTreeCollisionManagerd manager;
  std::vector<std::shared_ptr<fcl::Boxd>> boxes;
  std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects;
  std::vector<std::pair<int, int>> pairs;  // both ways round
};

BodyPairs::BodyPairs(const Model& model, double reach_m, double skin_m, bool own)
    : model_(model),
      reach_m_(reach_m),
      skin_m_(skin_m),
      own_(own),
      reference_m_(model.rest_position_m),
      motion_(model.bodies.size()),
      renewed_(model.bodies.size()),
      roomy_(model.bodies.size()),
      broad_(std::make_unique<Broad>()) {
  for (const Body& body : model.bodies) trees_.emplace_back(model, body);
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    broad_->boxes.push_back(std::make_shared<fcl::Boxd>(1, 1, 1));
    broad_->objects.push_back(std::make_unique<fcl::CollisionObjectd>(broad_->boxes.back()));
    broad_->objects.back()->setUserData(reinterpret_cast<void*>(b));
    broad_->manager.registerObject(broad_->objects.back().get());
  }
  broad_->manager.setup();
  broad_->pairs.reserve(kPairsPerBody * model.bodies.size() + 64);
  pairs_.reserve(broad_->pairs.capacity());
  old_pairs_.reserve(broad_->pairs.capacity());
}

BodyPairs::~BodyPairs() = default;

void BodyPairs::Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report) {
  const int bodies = static_cast<int>(trees_.size());
  parallel->For(bodies, kGrain, [&](int begin, int end) {
    for (int b = begin; b < end; ++b) {
      MeasureMotion(b, position_m);
      renewed_[b] = motion_[b].rest_m > kReferenceShare * skin_m_;
      if (renewed_[b]) RenewReference(b, position_m);
    }
  });
  for (int b = 0; b < bodies; ++b) {
    const Aabb now = BoxNow(b);
    if (roomy_[b].Contains(now.min) && roomy_[b].Contains(now.max)) continue;
    RenewPairs(report);
    break;
  }
  any_stale_ = false;
  for (BodyPair& pair : pairs_) {
    const BodyMotion &body = motion_[pair.body], &other = motion_[pair.other];
    const double beside_m = body.rest_m + other.rest_m;
    pair.moved_m = (other.mean_m - body.mean_m - pair.apart_m).norm() + beside_m;
    if (renewed_[pair.body] || renewed_[pair.other] || pair.moved_m > skin_m_) pair.stale = true;
    if (!pair.stale) continue;
    any_stale_ = true;
    pair.apart_m = other.mean_m - body.mean_m;
    pair.moved_m = beside_m;
  }
}

void BodyPairs::MeasureMotion(int b, std::span<const Vec3> position_m) {
  const Body& body = model_.bodies[b];
  const int end = body.first_particle + body.particle_count;
  BodyMotion& motion = motion_[b];
  motion.mean_m.setZero();
  for (int p = body.first_particle; p < end; ++p) motion.mean_m += position_m[p] - reference_m_[p];
  motion.mean_m /= body.particle_count;
  // What is not finite freezes the engine at the end of its step; until then nothing is looked for.
  if (!std::isfinite(motion.mean_m.sum())) motion.mean_m.setZero();
  double most_sq = 0;
  for (int p = body.first_particle; p < end; ++p) {
    most_sq = std::max(most_sq, (position_m[p] - reference_m_[p] - motion.mean_m).squaredNorm());
  }
  motion.rest_m = (std::isfinite(most_sq) ? std::sqrt(most_sq) : 0) + kRoundOff * reach_m_;
}

void BodyPairs::RenewReference(int b, std::span<const Vec3> position_m) {
  const Body& body = model_.bodies[b];
  std::copy_n(position_m.begin() + body.first_particle, body.particle_count,
              reference_m_.begin() + body.first_particle);
  trees_[b].Refit(reference_m_);
  motion_[b] = {Vec3::Zero(), kRoundOff * reach_m_};
}

Aabb BodyPairs::BoxNow(int b) const {
  const Aabb& then = trees_[b].bounds();
  const BodyMotion& motion = motion_[b];
  return Aabb{then.min + motion.mean_m, then.max + motion.mean_m}.Grown(motion.rest_m +
                                                                        0.5 * reach_m_);
}

// Pairs that were there before keep their lists.
void BodyPairs::RenewPairs(StepReport* report) {
  for (std::size_t b = 0; b < trees_.size(); ++b) {
    roomy_[b] = BoxNow(static_cast<int>(b)).Grown(skin_m_);
    fcl::CollisionObjectd& object = *broad_->objects[b];
    broad_->boxes[b]->side = roomy_[b].max - roomy_[b].min;
    broad_->boxes[b]->computeLocalAABB();
    object.setTranslation(0.5 * (roomy_[b].min + roomy_[b].max));
    object.computeAABB();
  }
  broad_->manager.update();
  std::vector<std::pair<int, int>>& found = broad_->pairs;
  found.clear();
  for (int b = 0; own_ && b < static_cast<int>(trees_.size()); ++b) {
    if (!model_.bodies[b].rigid && !model_.bodies[b].all_fixed) found.emplace_back(b, b);
  }
  broad_->manager.collide(
      &found, [](fcl::CollisionObjectd* first, fcl::CollisionObjectd* second, void* data) {
        auto& pairs = *static_cast<std::vector<std::pair<int, int>>*>(data);
        const int a = static_cast<int>(reinterpret_cast<std::intptr_t>(first->getUserData()));
        const int b = static_cast<int>(reinterpret_cast<std::intptr_t>(second->getUserData()));
        if (pairs.size() + 2 > pairs.capacity()) return true;  // enough
        pairs.emplace_back(a, b);
        pairs.emplace_back(b, a);
        return false;
      });
  if (found.size() + 2 > found.capacity()) report->bits |= kStepCandidateCapacity;
  std::sort(found.begin(), found.end());
  old_pairs_.swap(pairs_);
  pairs_.clear();
  auto old = old_pairs_.begin();
  for (const auto& [a, b] : found) {
    if (model_.bodies[a].all_fixed && model_.bodies[b].all_fixed) continue;
    while (old != old_pairs_.end() && std::pair(old->body, old->other) < std::pair(a, b)) ++old;
    const bool known = old != old_pairs_.end() && old->body == a && old->other == b;
    if (known) {
      pairs_.push_back(*old);
    } else {
      pairs_.push_back({.body = a, .other = b});
    }
  }
}

}  // namespace adhesim
