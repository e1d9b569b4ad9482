#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "core/contact/body_pairs.h"
#include "core/contact/box_list.h"
#include "core/contact/list_store.h"
#include "core/contact/rest_neighbours.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/parallel.h"

namespace adhesim {

// Edge `a` of one body that crosses over edge `b` of another (or of its own, elsewhere), nearest in
// both edges' insides.
struct NearEdges {
  std::array<std::int32_t, 2> ends;  // of edge a, ascending
  double s;                          // its contact point is (1 - s) ends[0] + s ends[1]
  std::int32_t triangle;             // the lowest that edge b belongs to
  Vec3 weights;                      // of b's contact point in `triangle`; exactly one is zero
  Vec3 normal;                       // unit, from b to the side a belongs on
  double gap_m;                      // along `normal`: negative where the surfaces cross
};

// Finds edges within reach of other bodies' edges where no particle is: what particles against
// triangles cannot see, so that without it two coarse surfaces interlock.
//
// With p, q the nearest points of the lines, inside both edges, and o = (p - q) / |p - q|: a pair
// counts where o leads away from both faces at b and -o from both faces at a (within kTolerance).
// Elsewhere some other feature of the two surfaces is nearer still, and is found as itself. A pair
// with the same seen from behind has crossed already; that can be told where a body is closed.
//
// Like Detector's, the lists have a margin and never change a result.
class EdgePairs {
 public:
  EdgePairs(const Model& model, double within_m);

  // Lists the edges of pair->body within `within_m` of those of pair->other; where these are one
  // body, without what `rest` says never collides. False: there is no room for all.
  bool List(BodyPair* pair, const BodyPairs& bodies, RestNeighbours* rest,
            std::span<const Vec3> position_m, Simd simd);
  // As of a ListStore.
  bool crowded() const { return candidates_.crowded(); }
  void BeginCopy() { candidates_.BeginCopy(); }
  void Keep(ListSpan* list) { candidates_.Keep(list); }
  void EndCopy() { candidates_.EndCopy(); }

  // Pairs with |gap| <= reach, ascending by (edge a, edge b), but for those whose four ends move as
  // one: `moves_with` [#particles] has one number >= 0 for them; empty: none do. Allocates nothing.
  std::span<const NearEdges> Find(const BodyPairs& bodies, std::span<const Vec3> position_m,
                                  std::span<const std::int32_t> moves_with, double reach_m,
                                  Parallel* parallel, StepReport* report);

 private:
  // Sine of the angle by which o may lead into a face. 0 would lose edges between coplanar faces to
  // round-off; a little more holds what is about to become nearest.
  static constexpr double kTolerance = 0.1;

  static constexpr int kLanes = 8;
  struct Edge {
    std::array<std::int32_t, 2> ends;      // ascending
    std::array<std::int32_t, 2> triangle;  // ascending; the second is -1 at a border
    std::array<std::int32_t, 2> opposite;  // the third corners of these
  };
  using EdgePair = std::pair<std::int32_t, std::int32_t>;
  struct Candidate {
    std::int32_t a, b;
    float distance_m;  // when it was listed, or less
  };
  Aabb BoxOf(int edge, std::span<const Vec3> position_m) const;
  // Calls visit(edge) for every edge of the body that may overlap `box`.
  template <typename Visit>
  void QueryEdges(const BodyPairs& bodies, int body, const Aabb& box, const Visit& visit) const;
  template <typename Query>
  bool ListEdge(int edge, const RestNeighbours* rest, std::span<const Vec3> position_m,
                const Query& query);
  void MarkInside(int begin, int end, double reach_sq_m2, std::span<const Vec3> position_m);
  void CollectWork(const BodyPairs& bodies, std::span<const std::int32_t> moves_with,
                   double reach_m);
  bool BelongTogether(const RestNeighbours& rest, const Edge& a, const Edge& b) const;
  // Where two lines are nearest, if that is inside both edges and within reach.
  struct Crossing {
    double s, t;
    Vec3 offset;  // from b to a
  };
  bool Cross(const EdgePair& pair, std::span<const Vec3> position_m, double reach_sq_m2,
             Crossing* crossing) const;
  bool LeadsAway(const Edge& edge, bool closed, const Vec3& direction,
                 std::span<const Vec3> position_m) const;
  bool Evaluate(const EdgePair& pair, const Crossing& crossing, std::span<const Vec3> position_m,
                NearEdges* near) const;

  const Model& model_;
  double within_m_;
  std::vector<Edge> edges_;                         // body by body
  std::vector<std::array<std::int32_t, 2>> ends_;   // [#edges] the same, where many are looked at
  std::vector<std::int32_t> first_edge_;            // [#bodies + 1]
  std::vector<std::array<std::int32_t, 3>> owned_;  // [#triangles] edges it is the lowest of, -1
  std::vector<std::int32_t> nearby_;                // edges of one body near another, in List()
  BoxList boxes_;                                   // of the other's
  ListStore<Candidate> candidates_;                 // of two bodies each, by distance
  std::vector<EdgePair> work_;                      // edges that may be within reach
  std::vector<std::uint8_t> crosses_;               // [#work]
  std::vector<NearEdges> near_;
};

}  // namespace adhesim
