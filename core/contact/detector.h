#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/contact/body_pairs.h"
#include "core/contact/box_list.h"
#include "core/contact/edge_pairs.h"
#include "core/contact/list_store.h"
#include "core/contact/rest_neighbours.h"
#include "core/model/closest_point.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/near_pair.h"
#include "core/model/parallel.h"

namespace adhesim {

// Finds the particles within `reach` of other bodies' surfaces, and the edges that cross over other
// bodies' edges.
//
// Pairs of bodies come from FCL's dynamic AABB tree (BodyPairs); particles against triangles from
// our own refitted trees, because FCL's narrow phase is ten times slower than a step may last
// (docs/decisions). What is near is listed with a margin (`skin`), two bodies at a time, and a list
// is used until these two have moved too far; what a list contains never changes a result.
class Detector {
 public:
  struct Options {
    bool edges = false;  // edges over edges are wanted too
    // Deformable bodies' surfaces against themselves too, where they are further apart than this at
    // rest. Of a closed body that is seen from outside only: from inside it is its own thickness.
    std::optional<double> self_apart_m;
  };
  Detector(const Model& model, double reach_m, const Options& options);
  Detector(const Model& model, double reach_m) : Detector(model, reach_m, Options()) {}

  // Renews the lists of bodies that have moved too far since these were made. Report bit:
  // kStepCandidateCapacity.
  void Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report);
  // Pairs with |gap| <= reach at these positions (those of the last Update), ascending by
  // (particle, body).
  std::span<const NearPair> Find(std::span<const Vec3> position_m, Parallel* parallel);

  // The same for edges over edges, but for those that move as one (EdgePairs::Find); those that
  // could not be listed are reported.
  std::span<const NearEdges> FindEdges(std::span<const Vec3> position_m,
                                       std::span<const std::int32_t> moves_with, Parallel* parallel,
                                       StepReport* report);

  double reach_m() const { return reach_m_; }
  // Bodies that sleep are not looked at; to be called again whenever one has fallen asleep. Null:
  // nothing does.
  void LeaveOut(const Sleep* sleep) {
    sleep_ = sleep;
    bodies_.LeaveOut(sleep);
  }
  // All pairs of bodies that may be within reach of each other.
  std::span<const BodyPair> pairs() const { return bodies_.pairs(); }
  // Upper bound of the speed at which surfaces of different bodies nearer than reach_m() close in,
  // at these velocities and the positions of the last Update; `enough` or less when it is no more
  // than that.
  double ClosingSpeed(std::span<const Vec3> position_m, std::span<const Vec3> velocity_m_s,
                      double enough_m_s);
  // Calls visit(triangle) for every triangle of any body that is in `box`, and some more near it.
  template <typename Visit>
  void QueryTriangles(const Aabb& box, const Visit& visit) const {
    for (int b = 0; b < static_cast<int>(box_.size()); ++b) bodies_.Query(b, box, visit);
  }

 private:
  struct Candidate {
    std::int32_t triangle;
    float distance_m;  // when it was listed, or less
  };
  // The triangles of one body that are near one particle.
  struct Group {
    std::int32_t particle;
    std::int32_t first, count;  // of its pair's candidates, by distance
    float distance_m;           // of the first
  };
  // A group that may be within reach now.
  struct Work {
    std::int32_t particle, body;
    ListSpan candidates;
    double nearer_m;  // by how much its sides may have come nearer since it was listed
  };
  void Renew(std::span<const Vec3> position_m, Simd simd, StepReport* report);
  bool List(BodyPair* pair, std::span<const Vec3> position_m, Simd simd);
  template <typename Query>
  bool ListGroup(int particle, bool own, std::span<const Vec3> position_m, const Query& query);
  void CopyLists();
  bool BelongTogether(int particle, int triangle) const;
  void CollectWork();
  NearPair Evaluate(const Work& work, std::span<const Vec3> position_m) const;
  Vec3 Pseudonormal(int triangle, ClosestPoint::Feature feature,
                    std::span<const Vec3> position_m) const;

  const Model& model_;
  double reach_m_;
  double skin_m_;
  const Sleep* sleep_ = nullptr;
  BodyPairs bodies_;
  std::vector<Aabb> box_, velocity_box_;  // [#bodies] of ClosingSpeed
  std::vector<std::array<std::int32_t, 3>>
      across_;  // [#triangles] triangle across the edge k to k + 1, or -1
  ListStore<Group> groups_;
  ListStore<Candidate> candidates_;
  BoxList boxes_;                    // of the other's triangles, in List()
  std::vector<Work> work_;           // ascending by (particle, body)
  std::vector<NearPair> evaluated_;  // [#work]
  std::vector<NearPair> near_;
  std::unique_ptr<RestNeighbours> rest_;   // null: no self-collision
  std::unique_ptr<EdgePairs> edge_pairs_;  // null: not wanted
};

}  // namespace adhesim
