#include "core/contact/edge_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace adhesim {
namespace {

constexpr int kGrain = 1024;  // candidates: about 20 us of work
constexpr int kCandidatesPerParticle = 64;

std::size_t Capacity(const Model& model) {
  return kCandidatesPerParticle * model.rest_position_m.size() + 4096;
}
constexpr double kRoundOff = 1e-12;  // of sums of a few products
constexpr double kParallel = 1e-12;  // squared sine of an angle between edges without a crossing

// Squared distance of two segments (Ericson, Real-Time Collision Detection (2005), section 5.1.9).
double SegmentDistanceSq(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1) {
  const Vec3 u = a1 - a0, v = b1 - b0, w = a0 - b0;
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double uw = u.dot(w), vw = v.dot(w);
  const double det = uu * vv - uv * uv;
  const auto fraction = [](double part, double whole) {
    return whole > 0 ? std::clamp(part / whole, 0.0, 1.0) : 0.0;
  };
  double s = det > kParallel * uu * vv ? fraction(uv * vw - uw * vv, det) : 0;
  const double t = fraction(uv * s + vw, vv);
  s = fraction(uv * t - uw, uu);
  return (w + s * u - t * v).squaredNorm();
}

}  // namespace

EdgePairs::EdgePairs(const Model& model, double within_m)
    : model_(model), within_m_(within_m), candidates_(Capacity(model)) {
  owned_.assign(model.triangles.size(), {-1, -1, -1});
  std::map<std::pair<int, int>, int> number;
  for (const Body& body : model.bodies) {
    first_edge_.push_back(static_cast<int>(edges_.size()));
    for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
      const Triangle& tri = model.triangles[t];
      for (int k = 0; k < 3; ++k) {
        const auto [low, high] = std::minmax(tri[k], tri[(k + 1) % 3]);
        const auto [at, first] = number.try_emplace({low, high}, static_cast<int>(edges_.size()));
        if (first) {
          owned_[t][k] = at->second;
          edges_.push_back({{low, high}, {t, -1}, {tri[(k + 2) % 3], -1}});
        } else if (Edge& edge = edges_[at->second]; edge.triangle[1] < 0) {
          edge.triangle[1] = t;
          edge.opposite[1] = tri[(k + 2) % 3];
        }
      }
    }
  }
  first_edge_.push_back(static_cast<int>(edges_.size()));
  for (const Edge& edge : edges_) ends_.push_back(edge.ends);
  int most = 0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b)
    most = std::max(most, first_edge_[b + 1] - first_edge_[b]);
  nearby_.reserve(most);
  work_.reserve(Capacity(model));
  crosses_.reserve(Capacity(model));
  near_.reserve(8 * model.rest_position_m.size() + 64);
}

Aabb EdgePairs::BoxOf(int edge, std::span<const Vec3> position_m) const {
  const Vec3 &a = position_m[ends_[edge][0]], &b = position_m[ends_[edge][1]];
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

template <typename Visit>
void EdgePairs::QueryEdges(const BodyPairs& bodies, int body, const Aabb& box,
                           const Visit& visit) const {
  bodies.Query(body, box, [&](int t) {
    for (int edge : owned_[t]) {
      if (edge >= 0) visit(edge);
    }
  });
}

bool EdgePairs::List(BodyPair* pair, const BodyPairs& bodies, RestNeighbours* rest,
                     std::span<const Vec3> position_m, Simd simd) {
  const Aabb near = bodies.BoxNow(pair->other).Grown(within_m_);
  nearby_.clear();
  Aabb near_box;
  // Without a region nothing of the two is near.
  const int end = bodies.region(*pair).empty() ? 0 : first_edge_[pair->body + 1];
  for (int e = first_edge_[pair->body]; e < end; ++e) {
    const Aabb box = BoxOf(e, position_m);
    if (!near.Overlaps(box)) continue;
    nearby_.push_back(e);
    near_box.Add(box);
  }
  near_box = near_box.Grown(within_m_);
  boxes_.Clear();
  bool few = true;
  QueryEdges(bodies, pair->other, near_box, [&](int e) {
    const Aabb box = BoxOf(e, position_m);
    if (few && near_box.Overlaps(box)) few = boxes_.Push(e, box);
  });
  candidates_.Begin();
  bool room = true;
  for (int e : nearby_) {
    if (!room) break;
    if (rest) {
      rest->Of(edges_[e].ends[0]);
      rest->And(edges_[e].ends[1]);
    }
    const Aabb box = BoxOf(e, position_m).Grown(within_m_);
    room = few ? ListEdge(e, rest, position_m,
                          [&](const auto& visit) { boxes_.Query(simd, box, visit); })
               : ListEdge(e, rest, position_m, [&](const auto& visit) {
                   QueryEdges(bodies, pair->other, box, [&](int other) {
                     if (box.Overlaps(BoxOf(other, position_m))) visit(other);
                   });
                 });
  }
  pair->edges = candidates_.End();
  const std::span<Candidate> found = candidates_[pair->edges];
  std::sort(found.begin(), found.end(), [](const Candidate& c, const Candidate& d) {
    return std::tuple(c.distance_m, c.a, c.b) < std::tuple(d.distance_m, d.a, d.b);
  });
  return room;
}

// The edges near edge `e`, of those that query(visit) names.
template <typename Query>
bool EdgePairs::ListEdge(int e, const RestNeighbours* rest, std::span<const Vec3> position_m,
                         const Query& query) {
  const Vec3 &a0 = position_m[ends_[e][0]], &a1 = position_m[ends_[e][1]];
  bool room = true;
  query([&](int other) {
    // An edge of its own body: each pair once.
    if (rest && other <= e) return;
    const Vec3 &b0 = position_m[ends_[other][0]], &b1 = position_m[ends_[other][1]];
    const double distance_sq = SegmentDistanceSq(a0, a1, b0, b1);
    if (distance_sq > within_m_ * within_m_) return;
    if (rest && BelongTogether(*rest, edges_[e], edges_[other])) return;
    room = room && candidates_.Push({e, other, NoMoreThan(std::sqrt(distance_sq))});
  });
  return room;
}

// Whether edge `a`, whose ends `rest` is asked about, and `b` never collide.
bool EdgePairs::BelongTogether(const RestNeighbours& rest, const Edge& a, const Edge& b) const {
  if (rest.Include(b.ends[0]) || rest.Include(b.ends[1])) return true;
  const std::vector<Vec3>& x = model_.rest_position_m;
  return rest.TooNearAtRest(
      SegmentDistanceSq(x[a.ends[0]], x[a.ends[1]], x[b.ends[0]], x[b.ends[1]]));
}

// With a(s) = a0 + s u, b(t) = b0 + t v, w = a0 - b0, the nearest points of the lines are at
//   s = ((u.v)(v.w) - (v.v)(u.w)) / det,  t = ((u.u)(v.w) - (u.v)(u.w)) / det,
//   det = (u.u)(v.v) - (u.v)^2.
bool EdgePairs::Cross(const EdgePair& pair, std::span<const Vec3> position_m, double reach_sq_m2,
                      Crossing* crossing) const {
  const Edge &a = edges_[pair.first], &b = edges_[pair.second];
  const Vec3 &a0 = position_m[a.ends[0]], &b0 = position_m[b.ends[0]];
  const Vec3 u = position_m[a.ends[1]] - a0, v = position_m[b.ends[1]] - b0, w = a0 - b0;
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double uw = u.dot(w), vw = v.dot(w);
  const double det = uu * vv - uv * uv;
  if (!(det > kParallel * uu * vv)) return false;
  const double s = uv * vw - vv * uw, t = uu * vw - uv * uw;
  if (!(s > 0 && s < det && t > 0 && t < det)) return false;
  crossing->s = s / det;
  crossing->t = t / det;
  // An end that round-off makes of an inside is a particle's affair.
  if (crossing->s == 1 || crossing->t == 1) return false;
  crossing->offset = w + crossing->s * u - crossing->t * v;
  return crossing->offset.squaredNorm() <= reach_sq_m2;
}

// Marks of kLanes pairs at once those that Cross() may find inside both edges: all but one in
// thirty end here. A little more than Cross() takes, so that its own arithmetic decides.
void EdgePairs::MarkInside(int begin, int end, double reach_sq_m2,
                           std::span<const Vec3> position_m) {
  double u[3][kLanes] = {}, v[3][kLanes] = {}, w[3][kLanes] = {};
  for (int i = begin; i < end; ++i) {
    const std::array<std::int32_t, 2>& a = ends_[work_[i].first];
    const std::array<std::int32_t, 2>& b = ends_[work_[i].second];
    const Vec3 &a0 = position_m[a[0]], &a1 = position_m[a[1]];
    const Vec3 &b0 = position_m[b[0]], &b1 = position_m[b[1]];
    for (int k = 0; k < 3; ++k) {
      u[k][i - begin] = a1[k] - a0[k];
      v[k][i - begin] = b1[k] - b0[k];
      w[k][i - begin] = a0[k] - b0[k];
    }
  }
  std::uint8_t inside[kLanes];
  for (int l = 0; l < kLanes; ++l) {
    const auto dot = [l](const double(&x)[3][kLanes], const double(&y)[3][kLanes]) {
      return x[0][l] * y[0][l] + x[1][l] * y[1][l] + x[2][l] * y[2][l];
    };
    const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), uw = dot(u, w), vw = dot(v, w);
    const double det = uu * vv - uv * uv;
    const double s0 = uv * vw, s1 = vv * uw, t0 = uu * vw, t1 = uv * uw;
    const double s_off = kRoundOff * (std::abs(s0) + std::abs(s1) + uu * vv);
    const double t_off = kRoundOff * (std::abs(t0) + std::abs(t1) + uu * vv);
    const double s = s0 - s1, t = t0 - t1;
    // The lines' distance is |w . (u x v)| / sqrt(det).
    const double across = w[0][l] * (u[1][l] * v[2][l] - u[2][l] * v[1][l]) +
                          w[1][l] * (u[2][l] * v[0][l] - u[0][l] * v[2][l]) +
                          w[2][l] * (u[0][l] * v[1][l] - u[1][l] * v[0][l]);
    const double far = across * across - kRoundOff * dot(w, w) * uu * vv;
    inside[l] = (far <= reach_sq_m2 * (det + kRoundOff * uu * vv)) & (s > -s_off) &
                (s < det + s_off) & (t > -t_off) & (t < det + t_off);
  }
  std::copy(inside, inside + (end - begin), crosses_.begin() + begin);
}

// Whether `direction`, which is across the edge, leads away from its faces and, of a closed body,
// out of it.
bool EdgePairs::LeadsAway(const Edge& edge, bool closed, const Vec3& direction,
                          std::span<const Vec3> position_m) const {
  const Vec3& corner = position_m[edge.ends[0]];
  const Vec3 along = position_m[edge.ends[1]] - corner;
  for (int k = 0; k < 2 && edge.triangle[k] >= 0; ++k) {
    const Vec3 arm = position_m[edge.opposite[k]] - corner;
    // Across the edge into the face.
    const Vec3 inward = arm - (arm.dot(along) / along.squaredNorm()) * along;
    const double into = direction.dot(inward);
    if (into > 0 && into * into > kTolerance * kTolerance * inward.squaredNorm()) return false;
  }
  if (!closed) return true;
  Vec3 normal_sum = Vec3::Zero();
  for (int k = 0; k < 2 && edge.triangle[k] >= 0; ++k) {
    const Triangle& tri = model_.triangles[edge.triangle[k]];
    const Vec3 normal =
        (position_m[tri[1]] - position_m[tri[0]]).cross(position_m[tri[2]] - position_m[tri[0]]);
    const double length = normal.norm();
    if (length > 0) normal_sum += normal / length;
  }
  return direction.dot(normal_sum) >= 0;
}

bool EdgePairs::Evaluate(const EdgePair& pair, const Crossing& crossing,
                         std::span<const Vec3> position_m, NearEdges* near) const {
  const Edge &a = edges_[pair.first], &b = edges_[pair.second];
  const bool own = model_.body_of[a.ends[0]] == model_.body_of[b.ends[0]];
  const bool a_closed = model_.bodies[model_.body_of[a.ends[0]]].closed;
  const bool b_closed = model_.bodies[model_.body_of[b.ends[0]]].closed;
  const double distance = crossing.offset.norm();
  // Edges that meet leave the direction to their cross product.
  const Vec3 direction = distance > 0
                             ? Vec3(crossing.offset / distance)
                             : Vec3((position_m[a.ends[1]] - position_m[a.ends[0]])
                                        .cross(position_m[b.ends[1]] - position_m[b.ends[0]])
                                        .normalized());
  const auto faces = [&](const Vec3& from_b, bool as_sheets) {
    return LeadsAway(b, b_closed && !as_sheets, from_b, position_m) &&
           LeadsAway(a, a_closed && !as_sheets, -from_b, position_m);
  };
  const bool apart = faces(direction, false);
  if (!apart && own) return false;
  const bool crossed =
      !apart && (a_closed || b_closed || distance == 0) && faces(-direction, false);
  // Else the back of a surface that has folded over.
  if (!apart && !crossed && !faces(direction, true)) return false;
  near->normal = crossed ? Vec3(-direction) : direction;
  near->gap_m = crossed ? -distance : distance;
  near->ends = a.ends;
  near->s = crossing.s;
  near->triangle = b.triangle[0];
  const Triangle& tri = model_.triangles[near->triangle];
  for (int k = 0; k < 3; ++k) {
    near->weights(k) = tri[k] == b.ends[0] ? 1 - crossing.t : tri[k] == b.ends[1] ? crossing.t : 0;
  }
  return true;
}

void EdgePairs::CollectWork(const BodyPairs& bodies, std::span<const std::int32_t> moves_with,
                            double reach_m) {
  // What is listed of two edges in one zone stays as it is; of an aggregate these are most.
  const auto as_one = [&](const Candidate& candidate) {
    if (moves_with.empty()) return false;
    const auto &a = ends_[candidate.a], &b = ends_[candidate.b];
    const std::int32_t with = moves_with[a[0]];
    return with >= 0 && moves_with[a[1]] == with && moves_with[b[0]] == with &&
           moves_with[b[1]] == with;
  };
  work_.clear();
  for (const BodyPair& pair : bodies.pairs()) {
    if (pair.body > pair.other || bodies.BothStill(pair)) continue;
    const double nearer_m = bodies.nearer_m(pair);
    for (const Candidate& candidate : candidates_[pair.edges]) {
      // By distance: what was further apart cannot be in reach, nor what follows.
      if (candidate.distance_m - nearer_m > reach_m) break;
      if (!as_one(candidate)) work_.push_back({candidate.a, candidate.b});
    }
  }
}

std::span<const NearEdges> EdgePairs::Find(const BodyPairs& bodies,
                                           std::span<const Vec3> position_m,
                                           std::span<const std::int32_t> moves_with, double reach_m,
                                           Parallel* parallel, StepReport* report) {
  CollectWork(bodies, moves_with, reach_m);
  crosses_.resize(work_.size());
  parallel->VectorFor(static_cast<int>(work_.size()), kGrain, [&](int begin, int end) {
    for (int w = begin; w < end; w += kLanes)
      MarkInside(w, std::min(w + kLanes, end), reach_m * reach_m, position_m);
  });
  std::size_t crossing_count = 0;
  for (std::size_t w = 0; w < work_.size(); ++w) {
    if (crosses_[w]) work_[crossing_count++] = work_[w];
  }
  work_.resize(crossing_count);
  std::sort(work_.begin(), work_.end());
  near_.clear();
  for (const EdgePair& pair : work_) {
    Crossing crossing;
    NearEdges near;
    if (!Cross(pair, position_m, reach_m * reach_m, &crossing)) continue;
    if (!Evaluate(pair, crossing, position_m, &near)) continue;
    if (near_.size() == near_.capacity()) {
      report->bits |= kStepCandidateCapacity;
      break;
    }
    near_.push_back(near);
  }
  return near_;
}

}  // namespace adhesim
