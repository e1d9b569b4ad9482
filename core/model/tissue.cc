#include "core/model/tissue.h"

#include <algorithm>

namespace adhesim {

bool Holds(const v1::Region& region, const Model& model, int tetrahedron) {
  const Tetrahedron& tet = model.tetrahedra[tetrahedron];
  const std::vector<Vec3>& x = model.rest_position_m;
  const Vec3 centre = 0.25 * (x[tet[0]] + x[tet[1]] + x[tet[2]] + x[tet[3]]);
  const auto vector = [](const auto& list) {  // absent: the default, zero
    return list.size() == 3 ? Vec3(list[0], list[1], list[2]) : Vec3(Vec3::Zero());
  };
  switch (region.kind_case()) {
    case v1::Region::kAll:
      return region.all();
    case v1::Region::kHalfSpace:
      return (centre - vector(region.half_space().point_m()))
                 .dot(vector(region.half_space().normal())) <= 0;
    case v1::Region::kBall:
      return (centre - vector(region.ball().centre_m())).norm() <= region.ball().radius_m();
    case v1::Region::kLabel: {
      const std::int32_t label = model.tet_label[tetrahedron];
      return label >= 0 && static_cast<std::uint32_t>(label) == region.label();
    }
    case v1::Region::kGroup: {
      const std::int32_t group = model.tet_group[tetrahedron];
      return group >= 0 && model.group_names[group] == region.group();
    }
    case v1::Region::kBorder:  // of surfaces only
    case v1::Region::KIND_NOT_SET:
      return false;
  }
  return false;
}

std::vector<std::int32_t> TetrahedraOf(const v1::Elasticity& elasticity, const Model& model) {
  const auto& names = elasticity.bodies();
  std::vector<std::int32_t> tetrahedra;
  for (const Body& body : model.bodies) {
    const bool named = std::find(names.begin(), names.end(), body.scene_name) != names.end();
    if (body.rigid || !(named || names.empty())) continue;
    for (int t = 0; t < body.tetrahedron_count; ++t) {
      tetrahedra.push_back(body.first_tetrahedron + t);
    }
  }
  return tetrahedra;
}

int RegionOf(const v1::Elasticity& elasticity, const Model& model, int tetrahedron) {
  for (int r = elasticity.regions_size() - 1; r >= 0; --r) {
    if (Holds(elasticity.regions(r).where(), model, tetrahedron)) return r;
  }
  return -1;
}

Material MaterialOf(const v1::Elasticity& elasticity, const Model& model, int tetrahedron) {
  Material material{elasticity.young_modulus_pa(), elasticity.poisson_ratio()};
  if (const int r = RegionOf(elasticity, model, tetrahedron); r >= 0) {
    const v1::MaterialRegion& region = elasticity.regions(r);
    material.young_modulus_pa = region.young_modulus_pa();
    if (region.has_poisson_ratio()) material.poisson_ratio = region.poisson_ratio();
  }
  return material;
}

std::vector<double> CompliancesOf(const Model& model) {
  std::vector<double> sum(model.rest_position_m.size(), 0), count(sum.size(), 0);
  for (const v1::Effect& effect : model.scene.effects()) {
    if (!effect.has_elasticity()) continue;
    for (const std::int32_t t : TetrahedraOf(effect.elasticity(), model)) {
      const Material material = MaterialOf(effect.elasticity(), model, t);
      for (const std::int32_t p : model.tetrahedra[t]) {
        sum[p] += (1 - material.poisson_ratio * material.poisson_ratio) / material.young_modulus_pa;
        ++count[p];
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
