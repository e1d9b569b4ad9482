#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/model/lanes.h"
#include "core/model/simd.h"

namespace adhesim {

// Eight tetrahedra, one a lane. Corners ascend by particle. Lanes without a tetrahedron repeat the
// first with a volume of zero.
struct TetBatch {
  std::int32_t particle[4][kLanes] = {};
  Lanes3 gradient_1_m[3];  // b_1, b_2, b_3: gradients of the corners' shape functions at rest; b_0
                           // is minus their sum
  Lanes shear_j;           // mu V, V the volume at rest times its filled part
  Lanes lame_j;            // lambda V
  std::int32_t edge[6][kLanes] = {};          // of the pairs of corners 01, 02, 03, 12, 13, 23
  std::int32_t first_edge = 0, end_edge = 0;  // all of them are in [first, end)
};

// What the tetrahedra of a batch exert on their corners.
struct TetForces {
  Lanes3 elastic_n[4];
  Lanes3 damping_n[4];
  Lanes energy_j;
};

// Blocks K_ij [N/m] of the pairs of corners, in the order of TetBatch::edge: 3 x 3, column by
// column. A block's numbers lie together, since they are added to an edge's together.
struct TetBlocks {
  double block[6][kLanes][9];
};

// Rotations of the tetrahedra as quaternions x, y, z, w.
using TetRotations = Lanes[4];

// Elastic forces and energy of the corotational law (README.md); `rotation` holds the polar
// rotations, before the call a guess. Returns the lanes (bits) where they could not be found: the
// caller finds them and calls again.
unsigned CorotationalForces(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                            TetRotations rotation, TetForces* out);
// Its stiffness with these rotations, times `scale`.
void CorotationalStiffness(Simd simd, const TetBatch& batch, double scale,
                           const TetRotations& rotation, TetBlocks* out);

// Elastic forces and energy of the neo-Hookean law, without its collapse term. Returns the lanes
// (bits) with J < 0.2, which may have one.
unsigned NeoHookeanForces(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                          TetForces* out);
// Adds the collapse term of one lane.
void AddCollapseForces(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                       TetForces* out);
// Its stiffness, collapse term included, times `scale`.
void NeoHookeanStiffness(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                         double scale, TetBlocks* out);

// Whether J <= 0 in one lane.
bool IsInsideOut(const TetBatch& batch, int lane, std::span<const Vec3> position_m);
// |F - R|^2 in one lane.
double StrainSq(const TetBatch& batch, int lane, std::span<const Vec3> position_m);
// Replaces what the neo-Hookean law gave for one lane by the law of what recovers (README.md);
// returns |F - R|^2.
double SetRecoveryForces(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                         TetForces* out);
void SetRecoveryStiffness(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                          double scale, TetBlocks* out);

// Forces of Kelvin-Voigt damping of relaxation time `damping_s`, whatever the law.
void DampingForces(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                   std::span<const Vec3> velocity_m_s, double damping_s, TetForces* out);
// Adds their derivative in the velocities, negated, times `scale`.
void AddDampingStiffness(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                         double scale, TetBlocks* out);

inline Vec3 LaneOf(const Lanes3& lanes, int lane) {
  return {lanes.x.v[lane], lanes.y.v[lane], lanes.z.v[lane]};
}
inline void SetLane(const Vec3& v, int lane, Lanes3* lanes) {
  lanes->x.v[lane] = v.x();
  lanes->y.v[lane] = v.y();
  lanes->z.v[lane] = v.z();
}

// b_0 .. b_3 of one lane.
std::array<Vec3, 4> GradientsOf(const TetBatch& batch, int lane);
// dx/dX of one lane.
Mat3 DeformationGradient(const TetBatch& batch, int lane, std::span<const Vec3> position_m);

}  // namespace adhesim
