#include "core/model/tie_geometry.h"

#include "core/model/bond_geometry.h"

namespace adhesim {
namespace {

constexpr double kFlat = 1e-9;  // of |e_1| |e_2|: parallel edges span no frame

}  // namespace

BondNodes NodesOf(const Bond& bond, const Triangle& tri, const Vec3& weights) {
  if (bond.partner < 0) {
    return {{bond.particle, tri[0], tri[1], tri[2]}, {1, -weights(0), -weights(1), -weights(2)}};
  }
  const int k = OppositeCorner(bond.weights), i = (k + 1) % 3, j = (k + 2) % 3;
  return {{bond.particle, bond.partner, tri[i], tri[j]},
          {1 - bond.partner_weight, bond.partner_weight, -weights(i), -weights(j)}};
}

TieGeometry TieGeometryOf(const Bond& bond, const Model& model, std::span<const Vec3> x) {
  TieGeometry tie;
  tie.nodes = NodesOf(bond, model.triangles[bond.triangle],
                      Vec3(bond.weights[0], bond.weights[1], bond.weights[2]));
  if (bond.partner < 0) {
    tie.first = {0, -1, 1, 0};
    tie.second = {0, -1, 0, 1};
  } else {
    tie.first = {-1, 1, 0, 0};
    tie.second = {0, 0, -1, 1};
  }
  tie.offset_m = tie.e1 = tie.e2 = Vec3::Zero();
  // About the first node, so that far from the origin nothing is lost.
  const Vec3& origin = x[tie.nodes.particle[0]];
  for (int i = 0; i < TieGeometry::kNodes; ++i) {
    const Vec3 at = x[tie.nodes.particle[i]] - origin;
    tie.offset_m += tie.nodes.weight[i] * at;
    tie.e1 += tie.first[i] * at;
    tie.e2 += tie.second[i] * at;
  }
  const Vec3 across = tie.e1.cross(tie.e2);
  tie.length = tie.e1.norm();
  tie.area = across.norm();
  if (!(tie.area > kFlat * tie.length * tie.e2.norm())) {
    tie.area = 0;
    tie.frame = Mat3::Identity();
    return tie;
  }
  const Vec3 t = tie.e1 / tie.length, n = across / tie.area;
  tie.frame << t, n.cross(t), n;
  return tie;
}

Vec3 TieGeometry::Speed(const std::array<Vec3, kNodes>& velocity) const {
  Vec3 speed = Vec3::Zero(), u1 = Vec3::Zero(), u2 = Vec3::Zero();
  for (int i = 0; i < kNodes; ++i) {
    speed += nodes.weight[i] * velocity[i];
    u1 += first[i] * velocity[i];
    u2 += second[i] * velocity[i];
  }
  if (area == 0) return speed;
  const Vec3 b = frame.col(1), n = frame.col(2);
  const Vec3 turn = (n.dot(u2) * e1 - n.dot(u1) * e2) / area + (b.dot(u1) / length) * n;
  return speed - turn.cross(offset_m);
}

std::array<Vec3, TieGeometry::kNodes> TieGeometry::Forces(const Vec3& f) const {
  Vec3 f1 = Vec3::Zero(), f2 = Vec3::Zero();  // what turns with the edges
  if (area > 0) {
    const Vec3 b = frame.col(1), n = frame.col(2);
    const Vec3 moment = offset_m.cross(f);
    f1 = (n.dot(moment) / length) * b - (e2.dot(moment) / area) * n;
    f2 = (e1.dot(moment) / area) * n;
  }
  std::array<Vec3, kNodes> forces;
  for (int i = 0; i < kNodes; ++i) forces[i] = nodes.weight[i] * f - first[i] * f1 - second[i] * f2;
  return forces;
}

}  // namespace adhesim
