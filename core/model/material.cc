#include "core/model/material.h"

#include <algorithm>

#include "core/model/carried.h"

namespace adhesim {
namespace {

Vec3 ToVec3(const google::protobuf::RepeatedField<double>& numbers) {
  return numbers.size() == 3 ? Vec3(numbers[0], numbers[1], numbers[2]) : Vec3(Vec3::Zero());
}

}  // namespace

bool HoldsTetrahedron(const v1::Region& region, const Model& model, int t) {
  Vec3 centre = Vec3::Zero();
  for (const std::int32_t p : model.tetrahedra[t]) centre += model.rest_position_m[p] / 4;
  switch (region.kind_case()) {
    case v1::Region::kAll:
      return region.all();
    case v1::Region::kHalfSpace:
      return (centre - ToVec3(region.half_space().point_m()))
                 .dot(ToVec3(region.half_space().normal())) <= 0;
    case v1::Region::kBall:
      return (centre - ToVec3(region.ball().centre_m())).norm() <= region.ball().radius_m();
    case v1::Region::kLabel:
      return model.tet_label[t] == static_cast<std::int64_t>(region.label());
    case v1::Region::kGroup:
      return model.tet_group[t] >= 0 && model.group_names[model.tet_group[t]] == region.group();
    case v1::Region::kBorder:
    case v1::Region::KIND_NOT_SET:
      return false;
  }
  return false;
}

Material MaterialOf(const v1::Elasticity& elasticity, const Model& model, int t) {
  Material material{elasticity.young_modulus_pa(), elasticity.poisson_ratio()};
  for (const v1::MaterialRegion& region : elasticity.regions()) {
    if (!HoldsTetrahedron(region.where(), model, t)) continue;
    material.young_modulus_pa = region.young_modulus_pa();
    material.poisson_ratio =
        region.has_poisson_ratio() ? region.poisson_ratio() : elasticity.poisson_ratio();
  }
  return material;
}

bool ActsOn(const v1::Elasticity& elasticity, const Body& body) {
  const auto& names = elasticity.bodies();
  const bool named = std::find(names.begin(), names.end(), body.scene_name) != names.end();
  return body.tetrahedron_count > 0 && (names.empty() || named);
}

std::vector<double> CompliancesOf(const Model& model) {
  std::vector<double> sum(model.rest_position_m.size(), 0), count(sum.size(), 0);
  for (const v1::Effect& effect : model.scene.effects()) {
    if (!effect.has_elasticity()) continue;
    for (const Body& body : model.bodies) {
      if (!ActsOn(effect.elasticity(), body)) continue;
      for (int t = body.first_tetrahedron; t < body.first_tetrahedron + body.tetrahedron_count;
           ++t) {
        const Material material = MaterialOf(effect.elasticity(), model, t);
        for (const std::int32_t p : model.tetrahedra[t]) {
          sum[p] +=
              (1 - material.poisson_ratio * material.poisson_ratio) / material.young_modulus_pa;
          ++count[p];
        }
      }
    }
  }
  for (const CarriedParticle& c : model.carried) {
    for (const std::int32_t carrier : c.carriers) {
      sum[c.particle] += sum[carrier];
      count[c.particle] += count[carrier];
    }
  }
  for (std::size_t p = 0; p < sum.size(); ++p) sum[p] = count[p] > 0 ? sum[p] / count[p] : 0;
  return sum;
}

}  // namespace adhesim
