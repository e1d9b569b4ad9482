#pragma once

#include <array>
#include <span>

#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// The four particles of a bond and their weights in its relative motion: a particle less the point
// of the triangle, or a point of one edge less that of the other.
struct BondNodes {
  std::array<std::int32_t, 4> particle;
  std::array<double, 4> weight;  // sum 0
};
BondNodes NodesOf(const Bond& bond, const Triangle& triangle, const Vec3& weights);

// A tie of two surfaces at a point: the offset d = sum of w_i x_i from one to the other keeps its
// components in a frame F that turns with the triangle (edges: with both), F^T d = offset. Three
// constraints on four particles, which no rigid motion changes: so forces along their gradients
// have neither a resultant nor a moment, however wide the gap (a plain tie of two points would
// leave the moment d x f).
//
// F has the first edge e_1 and the normal n of e_1 x e_2 as axes; with the edges' velocities u_1
// and u_2 it turns at
//   w = (e_1 (n.u_2) - e_2 (n.u_1)) / |e_1 x e_2| + n (b.u_1) / |e_1|,  b = n x e_1 / |e_1|,
// and the tie's speed is sum of w_i v_i - w x d.
struct TieGeometry {
  static constexpr int kNodes = 4;
  BondNodes nodes;
  std::array<double, kNodes> first, second;  // e_1 and e_2 as sums over the nodes
  Vec3 offset_m;                             // d
  Vec3 e1, e2;
  Mat3 frame;           // columns e_1 / |e_1|, b, n
  double area, length;  // |e_1 x e_2|, |e_1|; area 0: no frame, a plain tie

  Vec3 Speed(const std::array<Vec3, kNodes>& velocity) const;
  // Of a force f on the particle's side.
  std::array<Vec3, kNodes> Forces(const Vec3& f) const;
};

// What a tie carries on the particle's side, N; of the bond with this index.
struct TieLoad {
  std::int32_t bond;
  Vec3 load_n;
};

TieGeometry TieGeometryOf(const Bond& bond, const Model& model, std::span<const Vec3> position_m);

}  // namespace adhesim
