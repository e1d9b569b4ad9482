#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/contact/edge_pairs.h"
#include "core/contact/rest_neighbours.h"
#include "core/contact/triangle_tree.h"
#include "core/model/closest_point.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/near_pair.h"
#include "core/model/parallel.h"

namespace adhesim {

// Finds the particles within `reach` of other bodies' surfaces, and the edges that cross over other
// bodies' edges.
//
// Pairs of bodies come from FCL's dynamic AABB tree; particles against triangles from our own
// refitted trees, because FCL's narrow phase is ten times slower than a step may last
// (docs/decisions). Near pairs are listed with a margin
// (`skin`) and the list is used until something has moved half of it; what a list contains never
// changes a result.
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
  ~Detector();

  // Renews the list if particles have moved too far since it was made. Report bit:
  // kStepCandidateCapacity.
  void Update(std::span<const Vec3> position_m, Parallel* parallel, StepReport* report);
  // Pairs with |gap| <= reach at these positions (those of the last Update), ascending by
  // (particle, body).
  std::span<const NearPair> Find(std::span<const Vec3> position_m, Parallel* parallel);

  // The same for edges over edges (EdgePairs); those that could not be listed are reported.
  std::span<const NearEdges> FindEdges(std::span<const Vec3> position_m, Parallel* parallel,
                                       StepReport* report);

  double reach_m() const { return reach_m_; }
  // Upper bound of the speed at which surfaces of different bodies nearer than reach_m() close in,
  // at these velocities and the positions of the last Update; `enough` or less when it is no more
  // than that.
  double ClosingSpeed(std::span<const Vec3> position_m, std::span<const Vec3> velocity_m_s,
                      double enough_m_s);
  // Calls visit(triangle) for every triangle of any body whose box, grown by at most `skin`,
  // overlaps `box`.
  template <typename Visit>
  void QueryTriangles(const Aabb& box, const Visit& visit) const {
    for (const TriangleTree& tree : trees_) tree.Query(box, visit);
  }

 private:
  struct Broad;  // FCL's manager and its objects
  struct Candidate {
    std::int32_t triangle;
    double distance_m;  // when the list was made
  };
  // The triangles of one body that are near one particle.
  struct Group {
    std::int32_t particle, body;
    std::int32_t first, count;  // into candidate_
    double distance_m;          // when the list was made
  };
  void Rebuild(std::span<const Vec3> position_m, StepReport* report);
  void AddGroups(int a, int b, std::span<const Vec3> position_m, StepReport* report);
  bool BelongTogether(int particle, int triangle) const;
  // `nearer_m`: by how much its sides may have come nearer since the list was made.
  NearPair Evaluate(const Group& group, std::span<const Vec3> position_m, double nearer_m) const;
  void MeasureMotions(std::span<const Vec3> position_m);
  Vec3 Pseudonormal(int triangle, ClosestPoint::Feature feature,
                    std::span<const Vec3> position_m) const;

  const Model& model_;
  double reach_m_;
  double skin_m_;
  std::vector<TriangleTree> trees_;       // [#bodies]
  std::vector<Aabb> box_, velocity_box_;  // [#bodies] of ClosingSpeed
  std::vector<std::array<std::int32_t, 3>>
      across_;  // [#triangles] triangle across the edge k to k + 1, or -1
  std::unique_ptr<Broad> broad_;
  std::vector<Vec3> listed_position_m_;  // [#particles] when the list was made; empty: no list
  std::vector<BodyMotion> motion_;       // [#bodies] since then
  std::vector<Group> groups_;            // ascending by (particle, body)
  std::vector<Candidate> candidate_;     // group by group, by distance
  std::vector<NearPair> evaluated_;      // [#groups]
  std::vector<NearPair> near_;
  std::unique_ptr<EdgePairs> edge_pairs_;  // null: not wanted
  std::unique_ptr<RestNeighbours> rest_;   // null: no self-collision
};

}  // namespace adhesim
