#include "core/model/bond_geometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace adhesim {

Vec3 EdgeCross(const Bond& bond, const Model& model, std::span<const Vec3> position_m) {
  const Triangle& tri = model.triangles[bond.triangle];
  const int k = OppositeCorner(bond.weights);
  return (position_m[bond.partner] - position_m[bond.particle])
      .cross(position_m[tri[(k + 2) % 3]] - position_m[tri[(k + 1) % 3]]);
}

BondGeometry GeometryOf(const Bond& bond, const Model& model, std::span<const Vec3> position_m) {
  const Triangle& tri = model.triangles[bond.triangle];
  const Vec3 &a = position_m[tri[0]], &b = position_m[tri[1]], &c = position_m[tri[2]];
  BondGeometry geometry;
  geometry.point_m = position_m[bond.particle];
  if (bond.partner >= 0) {
    geometry.point_m = (1 - bond.partner_weight) * geometry.point_m +
                       bond.partner_weight * position_m[bond.partner];
  }
  const Vec3 offset =
      geometry.point_m - (bond.weights[0] * a + bond.weights[1] * b + bond.weights[2] * c);
  const double distance = offset.norm();
  geometry.gap_m = bond.gap_sign * distance;
  if (distance > 1e-3 * model.adhesive->capture_distance_m) {
    geometry.normal = offset * (bond.gap_sign / distance);
    return geometry;
  }
  // Too near to have a direction of its own: the surfaces'.
  const Vec3 across =
      bond.partner >= 0 ? EdgeCross(bond, model, position_m) : Vec3((b - a).cross(c - a));
  geometry.normal = across.normalized() * bond.side;
  return geometry;
}

BondLimit LimitOf(int tool, bool sticky, double area_m2, double mass_kg, const Model& model,
                  double most_pa) {
  const auto from_area = [&](const Strength& strength) -> BondLimit {
    return {std::min(strength.normal_pa, most_pa) * area_m2,
            std::min(strength.shear_pa, most_pa) * area_m2};
  };
  if (tool >= 0) return sticky ? from_area(model.tools[tool].strength) : BondLimit{};
  const AdhesiveParameters& adhesive = *model.adhesive;
  if (!adhesive.kappa) return from_area(adhesive.strength);
  const double force =
      adhesive.kappa->kappa_adh_m * mass_kg / (adhesive.kappa->dt_ref_s * adhesive.kappa->dt_ref_s);
  return {force, force};
}

BondLimit LimitOf(const Bond& bond, int member, const Model& model, double crack_area_m2) {
  const BondLimit one =
      LimitOf(bond.tool, bond.sticky, model.area_m2[member], model.mass_kg[member], model,
              CrackTraction(bond, member, model, crack_area_m2));
  return {bond.strength_scale * one.normal_n, bond.strength_scale * one.shear_n};
}

double CrackTraction(const Bond& bond, int member, const Model& model, double crack_area_m2) {
  const std::optional<double>& work_j_m2 = bond.tool >= 0
                                               ? model.tools[bond.tool].work_of_adhesion_j_m2
                                               : model.adhesive->work_of_adhesion_j_m2;
  if (!work_j_m2) return std::numeric_limits<double>::infinity();
  const std::vector<double>& compliance = model.compliance_per_pa;
  const bool of_particle = member == bond.particle || member == bond.partner;
  double both = compliance[member];
  if (of_particle) {
    both += compliance[model.triangles[bond.triangle][0]];
  } else if (bond.tool < 0) {
    both += compliance[bond.particle];
  }
  const double size_m = std::sqrt(crack_area_m2);
  return std::sqrt(4 * *work_j_m2 / (std::numbers::pi * both * size_m));
}

}  // namespace adhesim
