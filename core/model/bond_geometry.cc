#include "core/model/bond_geometry.h"

namespace adhesim {

BondGeometry GeometryOf(const Bond& bond, const Model& model, std::span<const Vec3> position_m) {
  const Triangle& tri = model.triangles[bond.triangle];
  const Vec3 &a = position_m[tri[0]], &b = position_m[tri[1]], &c = position_m[tri[2]];
  BondGeometry geometry;
  geometry.point_m = position_m[bond.particle];
  const Vec3 offset =
      geometry.point_m - (bond.weights[0] * a + bond.weights[1] * b + bond.weights[2] * c);
  const double distance = offset.norm();
  geometry.gap_m = bond.gap_sign * distance;
  // Too near to have a direction of its own: take the triangle's.
  geometry.normal = distance > 1e-3 * model.adhesive->capture_distance_m
                        ? Vec3(offset * (bond.gap_sign / distance))
                        : Vec3((b - a).cross(c - a).normalized() * bond.side);
  return geometry;
}

BondLimit LimitOf(const AdhesiveParameters& adhesive, double area_m2, double mass_kg) {
  if (!adhesive.kappa) {
    return {adhesive.strength.normal_pa * area_m2, adhesive.strength.shear_pa * area_m2};
  }
  const double force =
      adhesive.kappa->kappa_adh_m * mass_kg / (adhesive.kappa->dt_ref_s * adhesive.kappa->dt_ref_s);
  return {force, force};
}

}  // namespace adhesim
