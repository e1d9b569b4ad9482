#pragma once

#include <limits>
#include <span>

#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Where a bond between particles is, at the positions given.
struct BondGeometry {
  Vec3 point_m = Vec3::Zero();  // of the particle's side
  Vec3 normal = Vec3::UnitZ();  // unit, from the triangle's side to the particle's
  double gap_m = 0;             // along the normal
};

// The cross product of the two edges of an edge's bond, as in Bond::side.
Vec3 EdgeCross(const Bond& bond, const Model& model, std::span<const Vec3> position_m);

BondGeometry GeometryOf(const Bond& bond, const Model& model, std::span<const Vec3> position_m);

// The forces that an adhesive can carry.
struct BondLimit {
  double normal_n = 0;
  double shear_n = 0;
};

// On a part of a surface: from its area and the greatest traction there, or, with kappa_adh, from
// its mass. `tool`: what it is bonded to, -1: another body; a tool holds nothing where not sticky.
BondLimit LimitOf(int tool, bool sticky, double area_m2, double mass_kg, const Model& model,
                  double most_pa = std::numeric_limits<double>::infinity());
// On one particle that a bond holds; a crack runs over `crack_area_m2` at a time.
BondLimit LimitOf(const Bond& bond, int member, const Model& model, double crack_area_m2);
inline BondLimit LimitOf(const Bond& bond, int member, const Model& model) {
  return LimitOf(bond, member, model, model.area_m2[member]);
}

// The traction at which a crack with the work of adhesion w runs over a member of a bond, Pa: the
// mean over the size h = sqrt(crack_area_m2) of what lets go at once, of what stands ahead of a
// crack's tip, sqrt(4 E* w / (pi h)) (physics notes 3.3, item 8; K^2 = 2 E* w, 1 / E* the sum of
// both sides' (1 - nu^2) / E). Infinite where no work of adhesion is given.
double CrackTraction(const Bond& bond, int member, const Model& model, double crack_area_m2);

}  // namespace adhesim
