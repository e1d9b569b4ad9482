#include "core/scene/scene_rules.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "core/model/effect_name.h"
#include "core/model/rungs.h"
#include "core/scene/did_you_mean.h"
#include "core/scene/field_options.h"
#include "core/scene/quantity.h"

namespace adhesim {
namespace {

using google::protobuf::RepeatedField;
using google::protobuf::RepeatedPtrField;

// Quaternions written with three decimals are that far from unit length; they are normalised when
// the model is built.
constexpr double kUnitTolerance = 1e-3;

double Length(const RepeatedField<double>& v) {
  double sum = 0;
  for (const double x : v) sum += x * x;
  return std::sqrt(sum);
}

template <typename Named>
void CheckUniqueNames(const RepeatedPtrField<Named>& list, absl::string_view path,
                      Problems* problems) {
  std::map<std::string, int> first;
  for (int i = 0; i < list.size(); ++i) {
    if (list[i].name().empty()) continue;
    const auto [other, is_new] = first.emplace(list[i].name(), i);
    if (is_new) continue;
    problems->push_back({IndexPath(path, i) + ".name",
                         absl::StrCat(Quoted(list[i].name()), " is already the name of ",
                                      IndexPath(path, other->second))});
  }
}

void CheckRegion(const v1::Region& region, const std::string& path, Problems* problems) {
  if (region.kind_case() == v1::Region::kAll && !region.all()) {
    problems->push_back({path + ".all", "must be true; to select nothing leave the region out"});
  }
  if (region.kind_case() == v1::Region::kBorder && !region.border()) {
    problems->push_back({path + ".border", "must be true; to select nothing leave the region out"});
  }
  const RepeatedField<double>& normal = region.half_space().normal();
  if (normal.size() == 3 && std::isfinite(Length(normal)) && Length(normal) <= 0) {
    problems->push_back(
        {path + ".half_space.normal", "has no direction: its length is 0; permitted: above 0"});
  }
}

bool HasTetrahedra(const v1::Body& body) { return body.has_tetrahedra() || body.has_tet_mesh(); }

void CheckTetrahedra(const v1::Body& body, const std::string& path, Problems* problems) {
  const std::string field = path + (body.has_tetrahedra() ? ".tetrahedra" : ".tet_mesh");
  if (HasTetrahedra(body) && body.kind() == v1::BODY_KIND_RIGID) {
    problems->push_back({field,
                         "the body is rigid, and its inside never deforms; permitted: "
                         "deformable bodies"});
  }
  if (body.has_tetrahedra() && body.has_tet_mesh()) {
    problems->push_back({field,
                         "the file has tetrahedra of its own; permitted: shapes that are "
                         "surfaces"});
  }
  if (body.has_tetrahedra() && body.has_sheet()) {
    problems->push_back(
        {field, "a flat sheet has no inside; permitted: other shapes (a thin block)"});
  }
}

void CheckQuaternion(const RepeatedField<double>& wxyz, const std::string& path,
                     Problems* problems) {
  const double length = Length(wxyz);
  if (wxyz.size() != 4 || !std::isfinite(length) || std::abs(length - 1) <= kUnitTolerance) return;
  problems->push_back(
      {path, absl::StrCat("is a quaternion of length ", length, "; permitted: 1 within ",
                          kUnitTolerance, ", in the order w, x, y, z")});
}

void CheckTool(const v1::Tool& tool, const std::string& path, Problems* problems) {
  CheckQuaternion(tool.orientation_wxyz(), path + ".orientation_wxyz", problems);
  for (int i = 0; i < tool.trajectory_size(); ++i) {
    const v1::Waypoint& waypoint = tool.trajectory(i);
    const std::string waypoint_path = IndexPath(path + ".trajectory", i);
    CheckQuaternion(waypoint.orientation_wxyz(), waypoint_path + ".orientation_wxyz", problems);
    if (i == 0 || !waypoint.has_t_s() || !tool.trajectory(i - 1).has_t_s()) continue;
    if (waypoint.t_s() <= tool.trajectory(i - 1).t_s()) {
      problems->push_back({waypoint_path + ".t_s",
                           absl::StrCat("is ", NumberText(waypoint.t_s()), "; permitted: above ",
                                        NumberText(tool.trajectory(i - 1).t_s()),
                                        ", the time of the waypoint before")});
    }
  }
}

void CheckAdhesive(const v1::VirtualAdhesive& adhesive, const std::string& path,
                   Problems* problems) {
  if (adhesive.has_release_distance_m() && adhesive.has_capture_distance_m() &&
      adhesive.release_distance_m() <= adhesive.capture_distance_m()) {
    problems->push_back(
        {path + ".release_distance_m",
         absl::StrCat("is ", NumberText(adhesive.release_distance_m()), "; permitted: above ",
                      NumberText(adhesive.capture_distance_m()), ", the capture distance")});
  }
  if (adhesive.has_kappa_adh_m() &&
      (adhesive.has_normal_strength_pa() || adhesive.has_shear_strength_pa())) {
    problems->push_back({path + ".kappa_adh_m",
                         "excludes normal_strength_pa and shear_strength_pa: both state the "
                         "strength; write one form"});
  }
  if (adhesive.has_kappa_adh_m() && adhesive.has_work_of_adhesion_j_m2()) {
    problems->push_back({path + ".work_of_adhesion_j_m2",
                         "lowers strengths in Pa, and kappa_adh_m is none; permitted: "
                         "normal_strength_pa, or no strength"});
  }
  if (adhesive.ties() && (adhesive.has_patch_size_m() || adhesive.has_friction_coefficient())) {
    problems->push_back(
        {path + ".ties",
         absl::StrCat("excludes ",
                      adhesive.has_patch_size_m() ? "patch_size_m" : "friction_coefficient",
                      ": what is tied point by point has no zones to cut and "
                      "does not slide; permitted: one of them")});
  }
  if (adhesive.has_shear_strength_pa() && !adhesive.has_normal_strength_pa() &&
      !adhesive.has_kappa_adh_m()) {
    problems->push_back({path + ".shear_strength_pa", "needs normal_strength_pa beside it"});
  }
  if (adhesive.has_friction_coefficient() && !adhesive.has_normal_strength_pa() &&
      !adhesive.has_kappa_adh_m()) {
    problems->push_back({path + ".friction_coefficient",
                         "needs a strength beside it (normal_strength_pa or kappa_adh_m; 0 is "
                         "permitted): without one nothing ever lets go or slides"});
  }
}

// The traction at a crack's front depends on how stiff the tissue is.
void CheckWorkOfAdhesion(const v1::Scene& scene, const std::string& path, Problems* problems) {
  for (const v1::Body& body : scene.bodies()) {
    if (HasTetrahedra(body) || body.kind() == v1::BODY_KIND_RIGID) continue;
    const auto fixes_all = [](const v1::Region& region) { return region.all(); };
    if (std::any_of(body.fixed().begin(), body.fixed().end(), fixes_all)) continue;
    problems->push_back(
        {path, absl::StrCat("needs the stiffness of body ", Quoted(body.name()),
                            ", which is a surface; permitted: bodies of tetrahedra with "
                            "elasticity, rigid and fixed ones")});
  }
  const bool elastic = std::any_of(scene.effects().begin(), scene.effects().end(),
                                   [](const v1::Effect& e) { return e.has_elasticity(); });
  if (!elastic) problems->push_back({path, "needs the effect elasticity"});
}

void CheckLinks(const v1::ElasticLinks& links, const std::string& path, Problems* problems) {
  if (!links.has_max_length_m() || !links.has_capture_distance_m() ||
      links.max_length_m() > links.capture_distance_m()) {
    return;
  }
  problems->push_back(
      {path + ".max_length_m",
       absl::StrCat("is ", NumberText(links.max_length_m()), "; permitted: above ",
                    NumberText(links.capture_distance_m()),
                    ", the capture distance (a link would break as soon as it is made)")});
}

void CheckMuscle(const v1::Scene& scene, const v1::Muscle& muscle, const std::string& path,
                 Problems* problems) {
  if (muscle.direction_size() == 3 && std::isfinite(Length(muscle.direction())) &&
      Length(muscle.direction()) <= 0) {
    problems->push_back(
        {path + ".direction", "has no direction: its length is 0; permitted: above 0"});
  }
  for (int i = 0; i < muscle.bodies_size(); ++i) {
    for (const v1::Body& body : scene.bodies()) {
      if (body.name() == muscle.bodies(i) && body.kind() == v1::BODY_KIND_RIGID) {
        problems->push_back({IndexPath(path + ".bodies", i),
                             absl::StrCat("body ", Quoted(body.name()),
                                          " is rigid; permitted: deformable bodies")});
      }
    }
  }
  for (int i = 1; i < muscle.schedule_size(); ++i) {
    const v1::Activation &before = muscle.schedule(i - 1), &moment = muscle.schedule(i);
    if (!before.has_t_s() || !moment.has_t_s() || moment.t_s() > before.t_s()) continue;
    problems->push_back({IndexPath(path + ".schedule", i) + ".t_s",
                         absl::StrCat("is ", NumberText(moment.t_s()), "; permitted: above ",
                                      NumberText(before.t_s()), ", the time of the one before")});
  }
}

// Which bodies an effect can act on.
enum class ActsOn {
  kSurfaces,    // those without tetrahedra
  kEither,      // both, but only surfaces when none are named
  kTetrahedra,  // those with tetrahedra
};

// Why an effect cannot act on a body; empty: it can.
std::string Unfit(const v1::Body& body, ActsOn acts_on) {
  const std::string named = absl::StrCat("body ", Quoted(body.name()));
  if (body.kind() == v1::BODY_KIND_RIGID) {
    return named + " is rigid; permitted: deformable bodies";
  }
  if (acts_on == ActsOn::kSurfaces && HasTetrahedra(body)) {
    return named + " consists of tetrahedra; permitted: surfaces (its effect is elasticity)";
  }
  if (acts_on == ActsOn::kTetrahedra && !HasTetrahedra(body)) {
    return named +
           " is its surface only; permitted: bodies with tetrahedra (write `tetrahedra` beside its "
           "shape)";
  }
  return "";
}

// The bodies that an elastic effect acts on: those it names, or every deformable one of its kind.
// Reports those named that it cannot act on, and those that an earlier effect of the same kind (in
// `taken`) acts on.
void ClaimBodies(const v1::Scene& scene, const RepeatedPtrField<std::string>& named, ActsOn acts_on,
                 const std::string& path, std::map<std::string, int>* taken, int effect,
                 Problems* problems) {
  const auto claim = [&](const std::string& name, const std::string& where) {
    const auto [other, is_new] = taken->emplace(name, effect);
    if (is_new || other->second == effect) return true;
    problems->push_back(
        {where, absl::StrCat("acts on body ", Quoted(name), ", as effects[", other->second,
                             "] of the same kind already does; permitted: once a body")});
    return false;
  };
  if (named.empty()) {
    const ActsOn by_default = acts_on == ActsOn::kEither ? ActsOn::kSurfaces : acts_on;
    bool any = false, tissue = false;
    for (const v1::Body& body : scene.bodies()) {
      const bool fits = Unfit(body, by_default).empty();
      if (fits && !claim(body.name(), path)) return;
      any = any || fits;
      tissue = tissue || Unfit(body, ActsOn::kTetrahedra).empty();
    }
    if (!any && tissue && acts_on == ActsOn::kEither) {
      problems->push_back({path,
                           "acts on nothing: bodies of tetrahedra keep their volumes only where "
                           "`bodies` names them, and the scene has no other body that deforms",
                           /*warning=*/true});
    }
    return;
  }
  std::map<std::string, const v1::Body*> bodies;
  for (const v1::Body& body : scene.bodies()) bodies[body.name()] = &body;
  for (int i = 0; i < named.size(); ++i) {
    const std::string where = IndexPath(path + ".bodies", i);
    const auto found = bodies.find(named[i]);
    if (found == bodies.end()) continue;  // reported as an unknown name
    if (std::string why = Unfit(*found->second, acts_on); !why.empty()) {
      problems->push_back({where, std::move(why)});
    }
    claim(named[i], where);
  }
}

// Regions of materials are parts of a volume.
void CheckMaterials(const v1::Elasticity& elasticity, const std::string& path, Problems* problems) {
  for (int i = 0; i < elasticity.regions_size(); ++i) {
    const std::string where = IndexPath(path + ".regions", i) + ".where";
    CheckRegion(elasticity.regions(i).where(), where, problems);
    if (elasticity.regions(i).where().has_border()) {
      problems->push_back({where + ".border",
                           "is a part of surfaces; permitted: all, half_space, ball, label, "
                           "group"});
    }
  }
}

// What the effect's message says that it needs beside it.
void CheckNeeds(const v1::Scene& scene, const v1::Effect& effect, const std::string& path,
                Problems* problems) {
  const auto* kind = v1::Effect::descriptor()->FindFieldByName(EffectName(effect));
  if (kind == nullptr) return;
  const std::string& needed = kind->message_type()->options().GetExtension(v1::needs_effect);
  const auto is_needed = [&](const v1::Effect& other) { return EffectName(other) == needed; };
  if (needed.empty() || std::any_of(scene.effects().begin(), scene.effects().end(), is_needed)) {
    return;
  }
  problems->push_back({absl::StrCat(path, ".", kind->name()),
                       absl::StrCat("needs the effect ", needed, ", and the scene has none")});
}

// Nothing holds the particles of tetrahedra together but elasticity (`acted_on`: the bodies that
// have it).
void WarnOfDust(const v1::Scene& scene, const std::map<std::string, int>& acted_on,
                Problems* problems) {
  for (int i = 0; i < scene.bodies_size(); ++i) {
    const v1::Body& body = scene.bodies(i);
    const bool held = std::any_of(body.fixed().begin(), body.fixed().end(),
                                  [](const v1::Region& region) { return region.all(); });
    if (!Unfit(body, ActsOn::kTetrahedra).empty() || acted_on.contains(body.name()) || held)
      continue;
    problems->push_back(
        {IndexPath("bodies", i) + (body.has_tet_mesh() ? ".tet_mesh" : ".tetrahedra"),
         absl::StrCat("no effect holds the particles of body ", Quoted(body.name()),
                      " together: each moves by itself, as dust; needed: the effect "
                      "elasticity on this body"),
         /*warning=*/true});
  }
}

void CheckEffects(const v1::Scene& scene, Problems* problems) {
  // The effect that acts on each body.
  std::map<std::string, int> shape_memory, volume_preservation, elasticity;
  int adhesive = -1;
  for (int i = 0; i < scene.effects_size(); ++i) {
    const v1::Effect& effect = scene.effects(i);
    const std::string path = IndexPath("effects", i);
    CheckNeeds(scene, effect, path, problems);
    if (effect.has_shape_memory()) {
      ClaimBodies(scene, effect.shape_memory().bodies(), ActsOn::kSurfaces, path + ".shape_memory",
                  &shape_memory, i, problems);
    } else if (effect.has_volume_preservation()) {
      ClaimBodies(scene, effect.volume_preservation().bodies(), ActsOn::kEither,
                  path + ".volume_preservation", &volume_preservation, i, problems);
    } else if (effect.has_elasticity()) {
      ClaimBodies(scene, effect.elasticity().bodies(), ActsOn::kTetrahedra, path + ".elasticity",
                  &elasticity, i, problems);
      CheckMaterials(effect.elasticity(), path + ".elasticity", problems);
    } else if (effect.has_virtual_adhesive()) {
      if (adhesive >= 0) {
        problems->push_back(
            {path + ".virtual_adhesive",
             absl::StrCat("is already in the scene as effects[", adhesive, "]; permitted: one")});
      }
      adhesive = i;
      CheckAdhesive(effect.virtual_adhesive(), path + ".virtual_adhesive", problems);
      if (effect.virtual_adhesive().has_work_of_adhesion_j_m2()) {
        CheckWorkOfAdhesion(scene, path + ".virtual_adhesive.work_of_adhesion_j_m2", problems);
      }
    } else if (effect.has_elastic_links()) {
      CheckLinks(effect.elastic_links(), path + ".elastic_links", problems);
    } else if (effect.has_muscle()) {
      CheckMuscle(scene, effect.muscle(), path + ".muscle", problems);
    }
  }
  WarnOfDust(scene, elasticity, problems);
}

// Of what tools feel there is an error; elsewhere it says nothing.
void CheckRungs(const v1::Scene& scene, Problems* problems) {
  if (scene.tools().empty()) return;
  ForEachRung(scene.rungs(), [problems](const std::string& name, const v1::RungError& error) {
    if (error.has_force_error()) return;
    problems->push_back({absl::StrCat("rungs.", name, ".force_error"),
                         "required in a scene with tools, but missing; permitted: at least 0, "
                         "at most 1"});
  });
}

}  // namespace

void CheckSceneRules(const v1::Scene& scene, Problems* problems) {
  if (scene.bodies().empty())
    problems->push_back({"bodies", "the scene has no body; needed: at least one"});
  CheckUniqueNames(scene.bodies(), "bodies", problems);
  CheckUniqueNames(scene.tools(), "tools", problems);
  for (int i = 0; i < scene.bodies_size(); ++i) {
    CheckTetrahedra(scene.bodies(i), IndexPath("bodies", i), problems);
    for (int j = 0; j < scene.bodies(i).fixed_size(); ++j) {
      CheckRegion(scene.bodies(i).fixed(j), IndexPath(IndexPath("bodies", i) + ".fixed", j),
                  problems);
    }
  }
  for (int i = 0; i < scene.tools_size(); ++i)
    CheckTool(scene.tools(i), IndexPath("tools", i), problems);
  for (int i = 0; i < scene.tools_size(); ++i) {
    if (scene.tools(i).adhesion().has_work_of_adhesion_j_m2()) {
      CheckWorkOfAdhesion(scene, IndexPath("tools", i) + ".adhesion.work_of_adhesion_j_m2",
                          problems);
    }
  }
  CheckRungs(scene, problems);
  CheckEffects(scene, problems);
}

}  // namespace adhesim
