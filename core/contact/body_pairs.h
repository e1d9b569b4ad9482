#pragma once

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

namespace adhesim {

// How a body has moved from its reference: on the mean, and its particles beside that at most.
struct BodyMotion {
  Vec3 mean_m = Vec3::Zero();
  double rest_m = 0;
};

// Particles and edges of `body` near triangles and edges of `other`, which may be itself. Every two
// bodies are two of these; edges are listed where body <= other.
struct BodyPair {
  std::int32_t body, other;
  bool stale = true;                // its lists are to be made
  Vec3 apart_m = Vec3::Zero();      // other's mean motion less body's, when they were
  double moved_m = 0;               // at most so much nearer has anything come since
  double nearest_m = 0;             // particle to triangle, when they were
  ListSpan groups{}, candidates{};  // of Detector
  ListSpan edges{};                 // of EdgePairs
};

// Which bodies are near each other, and when what is listed of two of them must be listed anew.
//
// Every body has a reference, its shape at some time, and so has its tree; what is listed of two
// bodies holds for their references, each moved by its body's mean motion of then. Two that move
// together keep their lists, however far they go: a list with the margin `skin` holds until
//   |change of the difference of mean motions| + what particles moved beside these > skin.
// Only the lists of such a pair are renewed; a body whose particles moved more than a share of the
// skin beside its mean gets a new reference, and all its pairs new lists. Results must not depend
// on what is listed beyond the reach.
//
// Pairs of bodies come from FCL's dynamic AABB tree, with boxes that are renewed when a body has
// left its own.
class BodyPairs {
 public:
  // `own`: deformable bodies are paired with themselves too.
  BodyPairs(const Model& model, double reach_m, double skin_m, bool own);
  ~BodyPairs();

  // Renews references and pairs, and marks what is stale. Report bit: kStepCandidateCapacity.
  void Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report);

  // Ascending by (body, other).
  std::span<BodyPair> pairs() { return pairs_; }
  std::span<const BodyPair> pairs() const { return pairs_; }
  bool any_stale() const { return any_stale_; }
  std::span<const Vec3> reference_m() const { return reference_m_; }  // [#particles]
  const BodyMotion& motion(int body) const { return motion_[body]; }
  const TriangleTree& tree(int body) const { return trees_[body]; }  // of its reference

  // Calls visit(triangle) for every triangle of the body that is in `box` now, and some more.
  template <typename Visit>
  void Query(int body, const Aabb& box, const Visit& visit) const {
    const BodyMotion& motion = motion_[body];
    const Aabb before{box.min - motion.mean_m, box.max - motion.mean_m};
    trees_[body].Query(before.Grown(motion.rest_m), visit);
  }

 private:
  struct Broad;  // FCL's manager and its objects
  void MeasureMotion(int body, std::span<const Vec3> position_m);
  void RenewReference(int body, std::span<const Vec3> position_m);
  // A box around the body now, and half the reach more.
  Aabb BoxNow(int body) const;
  void RenewPairs(StepReport* report);

  const Model& model_;
  double reach_m_, skin_m_;
  bool own_;
  std::vector<TriangleTree> trees_;    // [#bodies]
  std::vector<Vec3> reference_m_;      // [#particles]
  std::vector<BodyMotion> motion_;     // [#bodies]
  std::vector<std::uint8_t> renewed_;  // [#bodies] reference, in this update
  std::vector<Aabb> roomy_;            // [#bodies] boxes that the pairs come from
  std::unique_ptr<Broad> broad_;
  std::vector<BodyPair> pairs_, old_pairs_;
  bool any_stale_ = false;
};

}  // namespace adhesim
