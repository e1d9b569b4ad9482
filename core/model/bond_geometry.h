#pragma once

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

BondGeometry GeometryOf(const Bond& bond, const Model& model, std::span<const Vec3> position_m);

// The forces that the adhesive between bodies can carry on one colliding particle.
struct BondLimit {
  double normal_n = 0;
  double shear_n = 0;
};

// From its area (a share of the surface) or, with kappa_adh, its mass.
BondLimit LimitOf(const AdhesiveParameters& adhesive, double area_m2, double mass_kg);

}  // namespace adhesim
