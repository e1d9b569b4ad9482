#include "core/contact/body_pairs.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/box.h>

#include <algorithm>
#include <cmath>

#include "core/model/awake.h"

namespace adhesim {
namespace {

constexpr double kRoundOff = 1e-9;  // of the reach: where distances are compared with old ones
constexpr double kReferenceShare =
    0.25;                   // of the skin: both of two may use that up, and half is left
constexpr int kGrain = 64;  // bodies: 40 particles each are about 20 us of work
// Of the skin: what is looked at closely is good for as long as nothing moves by half of this.
constexpr double kReserve = 0.25;
constexpr double kSlack = 2;  // of the skin
constexpr int kPairsPerBody = 32;
constexpr int kRegionsPerParticle = 24;

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
      slack_m_(kSlack * skin_m),
      own_(own),
      reference_m_(model.rest_position_m),
      motion_(model.bodies.size()),
      renewed_(model.bodies.size()),
      settled_(model.bodies.size()),
      roomy_(model.bodies.size()),
      broad_(std::make_unique<Broad>()),
      regions_(kRegionsPerParticle * model.rest_position_m.size() + 4096),
      round_of_(model.rest_position_m.size()) {
  for (const Body& body : model.bodies) trees_.emplace_back(model, body);
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    broad_->boxes.push_back(std::make_shared<fcl::Boxd>(1, 1, 1));
    broad_->objects.push_back(std::make_unique<fcl::CollisionObjectd>(broad_->boxes.back()));
    broad_->objects.back()->setUserData(reinterpret_cast<void*>(b));
    broad_->manager.registerObject(broad_->objects.back().get());
  }
  broad_->manager.setup();
  broad_->pairs.reserve(kPairsPerBody * model.bodies.size() + 64);
  base_m_.reserve(model.rest_position_m.size());
  pairs_.reserve(broad_->pairs.capacity());
  old_pairs_.reserve(broad_->pairs.capacity());
}

BodyPairs::~BodyPairs() = default;

void BodyPairs::Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report) {
  any_stale_ = false;
  if (!base_m_.empty()) {
    drift_m_ = std::sqrt(MostMovedSq(position_m));
    if (2 * drift_m_ <= kReserve * skin_m_) return;
  }
  base_m_.assign(position_m.begin(), position_m.end());
  drift_m_ = 0;
  const int bodies = static_cast<int>(trees_.size());
  parallel->For(bodies, kGrain, [&](int begin, int end) {
    for (int b = begin; b < end; ++b) {
      if (!Settled(b)) MeasureMotion(b, position_m);
    }
  });
  std::fill(renewed_.begin(), renewed_.end(), 0);
  for (BodyPair& pair : pairs_) {
    const BodyMotion &body = motion_[pair.body], &other = motion_[pair.other];
    const double moved_m =
        (other.mean_m - body.mean_m - pair.apart_m).norm() + (body.rest_m + other.rest_m);
    if (moved_m <= slack_m_ - kReserve * skin_m_) continue;
    pair.stale = true;
    // What the means did is gone with new lists; the rest needs new references.
    for (int b : {pair.body, pair.other})
      renewed_[b] |= motion_[b].rest_m > kReferenceShare * slack_m_;
  }
  if (!AllInRoomyBoxes()) RenewPairs(report);
  parallel->For(bodies, kGrain, [&](int begin, int end) {
    for (int b = begin; b < end; ++b) {
      if (renewed_[b]) RenewReference(b, position_m);
    }
  });
  MeasureRegions(position_m, parallel);
  for (int b = 0; sleep_ && b < bodies; ++b) settled_[b] = Sleeps(b);
  for (BodyPair& pair : pairs_) {
    const BodyPair& reverse = pairs_[pair.reverse];
    // The same bits for both of the pair: their lists are renewed together.
    pair.moved_m = (pair.motion.mean_m - reverse.motion.mean_m).norm() +
                   (pair.motion.rest_m + reverse.motion.rest_m);
    pair.stale |=
        renewed_[pair.body] || renewed_[pair.other] || pair.moved_m > (1 - kReserve) * skin_m_;
    any_stale_ |= pair.stale;
  }
  if (any_stale_) FindRegions(position_m, report);
}

double BodyPairs::MostMovedSq(std::span<const Vec3> position_m) const {
  static const Sleep kNone;
  double most_sq = 0;
  for (const auto& [begin, end] :
       AwakeRanges(static_cast<int>(position_m.size()), sleep_ ? *sleep_ : kNone)) {
    for (int p = begin; p < end; ++p) {
      most_sq = std::max(most_sq, (position_m[p] - base_m_[p]).squaredNorm());
    }
  }
  return most_sq;
}

bool BodyPairs::AllInRoomyBoxes() const {
  for (int b = 0; b < static_cast<int>(trees_.size()); ++b) {
    if (Settled(b)) continue;
    const Aabb now = BoxNow(b).Grown(0.5 * (reach_m_ + kReserve * skin_m_));
    if (!roomy_[b].Contains(now.min) || !roomy_[b].Contains(now.max)) return false;
  }
  return true;
}

void BodyPairs::MeasureRegions(std::span<const Vec3> position_m, Parallel* parallel) {
  parallel->For(static_cast<int>(pairs_.size()), kGrain, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      BodyPair& pair = pairs_[k];
      const std::span<const NearbyParticle> region = regions_[pair.region];
      if (pair.stale || region.empty() || MeasuredAsleep(pair)) continue;
      Vec3 mean_m = Vec3::Zero();
      for (const NearbyParticle& near : region) mean_m += position_m[near.particle] - near.listed_m;
      mean_m /= static_cast<double>(region.size());
      if (!std::isfinite(mean_m.sum())) mean_m.setZero();
      double most_sq = 0;
      for (const NearbyParticle& near : region) {
        most_sq =
            std::max(most_sq, (position_m[near.particle] - near.listed_m - mean_m).squaredNorm());
      }
      pair.motion = {mean_m,
                     (std::isfinite(most_sq) ? std::sqrt(most_sq) : 0) + kRoundOff * reach_m_};
    }
  });
}

void BodyPairs::FindRegions(std::span<const Vec3> position_m, StepReport* report) {
  const auto copy = [&] {
    regions_.BeginCopy();
    for (BodyPair& pair : pairs_) {
      if (pair.stale) pair.region = {};
      regions_.Keep(&pair.region);
    }
    regions_.EndCopy();
  };
  if (regions_.crowded()) copy();
  for (BodyPair& pair : pairs_) {
    if (!pair.stale) continue;
    const BodyMotion &body = motion_[pair.body], &other = motion_[pair.other];
    pair.apart_m = other.mean_m - body.mean_m;
    pair.motion = {Vec3::Zero(), kRoundOff * reach_m_};
    pair.moved_m = 2 * pair.motion.rest_m;
    if (!FindRegion(&pair, position_m)) report->bits |= kStepCandidateCapacity;
  }
}

// The corners of all triangles that meet the other body's box, at the references.
bool BodyPairs::FindRegion(BodyPair* pair, std::span<const Vec3> position_m) {
  const Body& body = model_.bodies[pair->body];
  const Aabb& bounds = trees_[pair->other].bounds();
  const Aabb box =
      Aabb{bounds.min + pair->apart_m, bounds.max + pair->apart_m}.Grown(reach_m_ + slack_m_);
  regions_.Begin();
  bool room = true;
  if (trees_[pair->body].bounds().Overlaps(box)) {
    ++round_;
    trees_[pair->body].Query(box, [&](int t) {
      for (int p : model_.triangles[t]) round_of_[p] = round_;
    });
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      if (round_of_[p] == round_) room = room && regions_.Push({position_m[p], p});
    }
  }
  pair->region = regions_.End();
  return room;
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
  return Aabb{then.min + motion.mean_m, then.max + motion.mean_m}.Grown(motion.rest_m + drift_m_);
}

// Pairs that were there before keep their lists.
void BodyPairs::RenewPairs(StepReport* report) {
  for (std::size_t b = 0; b < trees_.size(); ++b) {
    roomy_[b] = BoxNow(static_cast<int>(b)).Grown(0.5 * reach_m_ + slack_m_);
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
      // It, too, begins with at least half of the slack.
      for (int c : {a, b}) renewed_[c] |= motion_[c].rest_m > kReferenceShare * slack_m_;
    }
  }
  for (BodyPair& pair : pairs_) {
    const auto at = std::lower_bound(
        pairs_.begin(), pairs_.end(), std::pair(pair.other, pair.body),
        [](const BodyPair& p, const auto& key) { return std::pair(p.body, p.other) < key; });
    pair.reverse = static_cast<std::int32_t>(at - pairs_.begin());
  }
}

}  // namespace adhesim
