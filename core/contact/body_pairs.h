#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/contact/list_store.h"
#include "core/contact/triangle_tree.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/parallel.h"
#include "core/model/state.h"

namespace adhesim {

// How a body has moved from its reference: on the mean, and its particles beside that at most.
struct BodyMotion {
  Vec3 mean_m = Vec3::Zero();
  double rest_m = 0;
};

// A particle of a body near another, and where it was when that was listed.
struct NearbyParticle {
  Vec3 listed_m;
  std::int32_t particle;
};

// Particles and edges of `body` near triangles and edges of `other`, which may be itself. Every two
// bodies are two of these; edges are listed where body <= other.
struct BodyPair {
  std::int32_t body, other;
  std::int32_t reverse = 0;         // the pair (other, body)
  bool stale = true;                // its lists are to be made
  Vec3 apart_m = Vec3::Zero();      // other's mean motion less body's, when they were
  ListSpan region{};                // body's particles that may come within reach of `other`
  BodyMotion motion{};              // of the region since they were
  double moved_m = 0;               // at most so much nearer have the two regions come since
  double nearest_m = 0;             // particle to triangle, when they were
  ListSpan groups{}, candidates{};  // of Detector
  ListSpan edges{};                 // of EdgePairs
};

// Which bodies are near each other, where, and when what is listed of two of them must be listed
// anew. Two margins, of which results must not depend on either:
//
// Every body has a reference, its shape at some time, to which its tree is fitted. Of two bodies
// the regions are found that can come within reach of each other while
//   |change of the difference of the bodies' mean motions| + what particles moved beside these
// is no more than `slack`; then bodies whose shape has changed get new references.
//
// What is listed of the two regions with the margin `skin` holds until the same of these regions
// exceeds the skin. Where bodies stick to each other they move as one, however fast they and their
// far sides move: such lists last.
//
// All this is looked at only after something has moved by a share of the skin that is kept for it.
//
// Pairs of bodies come from FCL's dynamic AABB tree, with boxes that are renewed when a body has
// left its own.
class BodyPairs {
 public:
  // `own`: deformable bodies are paired with themselves too.
  BodyPairs(const Model& model, double reach_m, double skin_m, bool own);
  ~BodyPairs();

  // Bodies that sleep are not looked at; to be called again whenever one has fallen asleep.
  void LeaveOut(const Sleep* sleep) {
    sleep_ = sleep;
    base_m_.clear();
    std::fill(settled_.begin(), settled_.end(), 0);
  }
  // Neither of the two moves: nothing new can be found between them.
  bool BothStill(const BodyPair& pair) const { return Still(pair.body) && Still(pair.other); }

  // Renews references and pairs, marks what is stale and finds its regions. Report bit:
  // kStepCandidateCapacity.
  void Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report);

  // Ascending by (body, other).
  std::span<BodyPair> pairs() { return pairs_; }
  std::span<const BodyPair> pairs() const { return pairs_; }
  bool any_stale() const { return any_stale_; }
  // By how much the pair's regions may have come nearer since its lists were made.
  double nearer_m(const BodyPair& pair) const { return pair.moved_m + 2 * drift_m_; }
  // A pair's region.
  std::span<const NearbyParticle> region(const BodyPair& pair) const {
    return regions_[pair.region];
  }
  // A box around the body now.
  Aabb BoxNow(int body) const;

  // Calls visit(triangle) for every triangle of the body that is in `box` now, and some more.
  template <typename Visit>
  void Query(int body, const Aabb& box, const Visit& visit) const {
    const BodyMotion& motion = motion_[body];
    const Aabb before{box.min - motion.mean_m, box.max - motion.mean_m};
    trees_[body].Query(before.Grown(motion.rest_m + drift_m_), visit);
  }

 private:
  struct Broad;  // FCL's manager and its objects
  bool Sleeps(int body) const { return sleep_ && sleep_->Of(body); }
  bool Still(int body) const { return Sleeps(body) || model_.bodies[body].all_fixed; }
  // Asleep since it was looked at closely.
  bool Settled(int body) const { return settled_[body] && Sleeps(body); }
  bool MeasuredAsleep(const BodyPair& pair) const {
    return BothStill(pair) && (Settled(pair.body) || Settled(pair.other));
  }
  double MostMovedSq(std::span<const Vec3> position_m) const;
  void MeasureMotion(int body, std::span<const Vec3> position_m);
  void RenewReference(int body, std::span<const Vec3> position_m);
  bool AllInRoomyBoxes() const;
  void MeasureRegions(std::span<const Vec3> position_m, Parallel* parallel);
  bool FindRegion(BodyPair* pair, std::span<const Vec3> position_m);
  void FindRegions(std::span<const Vec3> position_m, StepReport* report);
  void RenewPairs(StepReport* report);

  const Model& model_;
  double reach_m_, skin_m_, slack_m_;
  bool own_;
  std::vector<TriangleTree> trees_;  // [#bodies]
  std::vector<Vec3> base_m_;        // [#particles] when all was looked at closely; empty: never yet
  double drift_m_ = 0;              // no particle has moved more since
  std::vector<Vec3> reference_m_;   // [#particles]
  std::vector<BodyMotion> motion_;  // [#bodies]
  std::vector<std::uint8_t> renewed_;  // [#bodies] reference, in this update
  std::vector<std::uint8_t> settled_;  // [#bodies] slept when all was looked at closely
  const Sleep* sleep_ = nullptr;       // null: nothing does
  std::vector<Aabb> roomy_;            // [#bodies] boxes that the pairs come from
  std::unique_ptr<Broad> broad_;
  std::vector<BodyPair> pairs_, old_pairs_;
  bool any_stale_ = false;
  ListStore<NearbyParticle> regions_;
  std::vector<std::uint32_t> round_of_;  // [#particles] FindRegion() that met it last
  std::uint32_t round_ = 0;
};

}  // namespace adhesim
