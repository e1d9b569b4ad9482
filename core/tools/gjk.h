#pragma once

#include <array>
#include <cmath>

#include "core/model/geometry.h"

namespace adhesim {

// The distance of two convex sets by the algorithm of Gilbert, Johnson and Keerthi (1988), in
// double.
//
// It walks over the difference set B - A towards the origin; each set is known only by its support
// point (the furthest along a direction). Bullet has the same algorithm in single precision, with
// an error of some 1e-5 of the size.

// A point of B - A with where it came from; `corner` is the caller's number of the point of B.
struct GjkVertex {
  Vec3 difference;
  Vec3 a;
  Vec3 b;
  int corner = 0;
};

// Up to four vertices and the point of their hull nearest to the origin.
struct GjkSimplex {
  std::array<GjkVertex, 4> vertices;
  std::array<double, 4> weights{};
  int count = 0;
  Vec3 nearest = Vec3::Zero();

  // Drops the vertices that the nearest point does not need and finds weights and `nearest`. Tries
  // every sub-simplex: slower than walking, and right for flat and repeated vertices.
  void Reduce();
};

struct GjkResult {
  bool overlap = false;
  Vec3 from_a_to_b = Vec3::Zero();  // between the nearest points; not to be used on overlap
  GjkSimplex simplex;               // weights of the points of B
};

struct SupportOfB {
  Vec3 point;
  int corner = 0;
};

// support_a(direction) -> Vec3, support_b(direction) -> SupportOfB. Allocates nothing; at most 64
// rounds.
template <typename SupportA, typename SupportB>
GjkResult Gjk(const SupportA& support_a, const SupportB& support_b) {
  constexpr int kMaxRounds = 64;
  const auto vertex = [&](const Vec3& towards_a) {
    const Vec3 a = support_a(Vec3(-towards_a));
    const SupportOfB b = support_b(towards_a);
    return GjkVertex{b.point - a, a, b.point, b.corner};
  };
  GjkResult result;
  GjkSimplex& simplex = result.simplex;
  simplex.vertices[0] = vertex(Vec3::UnitZ());
  simplex.count = 1;
  simplex.Reduce();
  double scale = 0;
  for (int round = 0; round < kMaxRounds; ++round) {
    const Vec3& v = simplex.nearest;
    scale = std::max(scale, simplex.vertices[simplex.count - 1].difference.norm());
    if (simplex.count == 4 || v.norm() <= 1e-14 * scale) {
      result.overlap = true;
      return result;
    }
    const GjkVertex next = vertex(Vec3(-v));
    // |v|^2 - v.w bounds how much nearer the sets can be; the second term is round-off of the
    // products.
    const double progress = v.squaredNorm() - v.dot(next.difference);
    if (progress <= 1e-13 * v.squaredNorm() + 1e-15 * v.norm() * scale) break;
    GjkSimplex trial = simplex;
    trial.vertices[trial.count++] = next;
    trial.Reduce();
    if (trial.nearest.squaredNorm() >= v.squaredNorm()) break;
    simplex = trial;
  }
  result.from_a_to_b = simplex.nearest;
  return result;
}

}  // namespace adhesim
