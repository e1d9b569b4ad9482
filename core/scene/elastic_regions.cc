#include "core/scene/elastic_regions.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "core/model/tissue.h"
#include "core/scene/field_value.h"

namespace adhesim {
namespace {

// What a label or a group may be, or where the centres are; empty: nothing to say.
std::string Permitted(const v1::Region& region, const Model& model,
                      const std::vector<std::int32_t>& tetrahedra) {
  std::set<std::int32_t> labels, groups;
  for (const std::int32_t t : tetrahedra) {
    if (model.tet_label[t] >= 0) labels.insert(model.tet_label[t]);
    if (model.tet_group[t] >= 0) groups.insert(model.tet_group[t]);
  }
  if (region.has_label()) {
    return labels.empty() ? "; its tetrahedra have no labels"
                          : absl::StrCat("; permitted: ", absl::StrJoin(labels, ", "));
  }
  if (region.has_group()) {
    std::vector<std::string> names;
    for (const std::int32_t group : groups) names.push_back(model.group_names[group]);
    return names.empty() ? "; its tetrahedra have no groups"
                         : absl::StrCat("; permitted: ", absl::StrJoin(names, ", "));
  }
  Aabb centres;
  for (const std::int32_t t : tetrahedra) {
    Vec3 sum = Vec3::Zero();
    for (const std::int32_t p : model.tetrahedra[t]) sum += model.rest_position_m[p];
    centres.Add(Vec3(0.25 * sum));
  }
  return absl::StrCat("; permitted: those that hold the centre of one, which lie within ",
                      ExtentText(centres));
}

}  // namespace

void CheckElasticRegions(const v1::Scene& scene, const Model& model, Problems* problems) {
  for (int i = 0; i < scene.effects_size(); ++i) {
    if (!scene.effects(i).has_elasticity()) continue;
    const v1::Elasticity& elasticity = scene.effects(i).elasticity();
    const std::string path = absl::StrCat("effects[", i, "].elasticity");
    const std::vector<std::int32_t> tetrahedra = TetrahedraOf(elasticity, model);
    if (tetrahedra.empty()) {
      problems->push_back({path,
                           "acts on no body of tetrahedra; needed: a body with tetrahedra or "
                           "tet_mesh"});
      continue;
    }
    for (int r = 0; r < elasticity.regions_size(); ++r) {
      const v1::Region& where = elasticity.regions(r).where();
      if (std::none_of(tetrahedra.begin(), tetrahedra.end(),
                       [&](std::int32_t t) { return Holds(where, model, t); })) {
        problems->push_back({absl::StrCat(path, ".regions[", r, "].where"),
                             absl::StrCat("selects no tetrahedron of the bodies that the effect "
                                          "acts on",
                                          Permitted(where, model, tetrahedra))});
      }
    }
  }
}

}  // namespace adhesim
