#include "core/scene/build_model.h"

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/model/tissue.h"
#include "core/scene/body_file.h"
#include "core/scene/body_mesh.h"
#include "core/scene/copies.h"
#include "core/scene/elastic_regions.h"
#include "core/scene/field_value.h"
#include "core/scene/mesh/topology.h"
#include "core/scene/place_body.h"

namespace adhesim {
namespace {

bool HasError(const Problems& problems) {
  return std::any_of(problems.begin(), problems.end(), [](const Problem& p) { return !p.warning; });
}

void BuildCopies(const v1::Body& body, const TetMesh& mesh, const std::string& path, Model* model,
                 Problems* problems) {
  // Different bodies of a scene do not share their places.
  const absl::StatusOr<std::vector<CopyPlace>> places =
      PlaceCopies(body.copies(), model->seed + model->bodies.size());
  if (!places.ok()) {
    problems->push_back({path + ".copies", std::string(places.status().message())});
    return;
  }
  const Vec3 position_m = Vec3Of(body, "position_m");
  v1::Body copy = body;
  for (std::size_t i = 0; i < places->size() && !HasError(*problems); ++i) {
    copy.set_name(absl::StrCat(body.name(), "-", i + 1));
    copy.clear_position_m();
    copy.clear_rotation_deg();
    for (int k = 0; k < 3; ++k) {
      copy.add_position_m(position_m(k) + (*places)[i].offset_m(k));
      copy.add_rotation_deg((*places)[i].rotation_deg(k));
    }
    PlaceBody(copy, mesh, path, model, problems);
    model->bodies.back().scene_name = body.name();
  }
}

// Positions some metres from the origin are rounded to 1e-15 m. Beside its weight, the stiffness of
// a tetrahedron makes of that a force that grows with the inverse square of its size: a free fall
// of one second errs by less than 1e-4 at edges of 3e-7 m, by 1.5 % at 1e-8 m and by 300 % at 1e-9.
constexpr double kLeastEdgeM = 1e-7;

void CheckEdges(const TetMesh& mesh, const std::string& path, Problems* problems) {
  double least_sq_m2 = kLeastEdgeM * kLeastEdgeM;
  const double permitted_sq_m2 = least_sq_m2;
  for (const Tetrahedron& t : mesh.tetrahedra) {
    for (int i = 0; i < 4; ++i) {
      for (int j = i + 1; j < 4; ++j) {
        const Vec3 edge = mesh.surface.vertices[t[i]] - mesh.surface.vertices[t[j]];
        least_sq_m2 = std::min(least_sq_m2, edge.squaredNorm());
      }
    }
  }
  if (least_sq_m2 >= permitted_sq_m2) return;
  problems->push_back({path, absl::StrCat("its shortest edge is ", std::sqrt(least_sq_m2),
                                          " m; permitted: at least ", kLeastEdgeM, " m")});
}

void BuildBody(const v1::Body& body, int index, const std::string& directory, Model* model,
               Problems* problems) {
  const std::string path = absl::StrCat("bodies[", index, "]");
  Problems found;
  const std::optional<TetMesh> mesh = MakeBodyMesh(body, path, directory, &found);
  if (mesh) {
    const std::int64_t copies = body.has_copies() ? body.copies().count() : 1;
    const auto refuse_above = [&](std::int64_t limit, std::int64_t present, std::int64_t added,
                                  const char* of_what) {
      if (present + copies * added <= limit) return;
      found.push_back({ShapePath(body, path),
                       absl::StrCat("brings the scene to ", present + copies * added, " ", of_what,
                                    "; at most ", limit, " are permitted")});
    };
    refuse_above(kMaxParticles, model->particle_count(), mesh->surface.vertices.size(),
                 "particles");
    refuse_above(kMaxTetrahedra, model->tetrahedra.size(), mesh->tetrahedra.size(), "tetrahedra");
    CheckEdges(*mesh, ShapePath(body, path), &found);
  }
  if (mesh && !HasError(found)) {
    if (body.has_copies()) {
      BuildCopies(body, *mesh, path, model, &found);
    } else {
      PlaceBody(body, *mesh, path, model, &found);
    }
  }
  problems->insert(problems->end(), found.begin(), found.end());
}

ToolShape ShapeOf(const v1::Tool& tool) {
  if (tool.has_lancet()) {
    const v1::Lancet& lancet = tool.lancet();
    return LancetShape{NumberOf(lancet, "blade_length_m"), NumberOf(lancet, "blade_width_m"),
                       NumberOf(lancet, "blade_thickness_m"), NumberOf(lancet, "handle_length_m"),
                       NumberOf(lancet, "handle_radius_m")};
  }
  const v1::Needle& needle = tool.needle();
  return NeedleShape{NumberOf(needle, "length_m"), NumberOf(needle, "radius_m"),
                     NumberOf(needle, "tip_length_m")};
}

CouplingParameters CouplingOf(const v1::VirtualCoupling& coupling) {
  CouplingParameters parameters;
  parameters.stiffness_n_m = NumberOf(coupling, "stiffness_n_m");
  parameters.angular_stiffness_nm_rad = NumberOf(coupling, "angular_stiffness_nm_rad");
  parameters.mass_kg = NumberOf(coupling, "mass_kg");
  parameters.max_force_n = NumberOf(coupling, "max_force_n");
  parameters.max_torque_nm = NumberOf(coupling, "max_torque_nm");
  parameters.max_speed_m_s = NumberOf(coupling, "max_speed_m_s");
  return parameters;
}

// The orientation in a field; identity and a problem when its numbers give none.
Quat OrientationOf(const google::protobuf::Message& message, const std::string& path,
                   Problems* problems) {
  const std::optional<Quat> orientation = QuatOf(message, "orientation_wxyz");
  if (!orientation) {
    problems->push_back({absl::StrCat(path, ".orientation_wxyz"),
                         "a quaternion w, x, y, z of length 0 is no orientation"});
  }
  return orientation.value_or(Quat::Identity());
}

void BuildTrajectory(const v1::Tool& tool, const std::string& path, ToolModel* built,
                     Problems* problems) {
  for (int i = 0; i < tool.trajectory_size(); ++i) {
    const v1::Waypoint& waypoint = tool.trajectory(i);
    const std::string waypoint_path = absl::StrCat(path, ".trajectory[", i, "]");
    TimedPose timed{waypoint.t_s(), {Vec3Of(waypoint, "position_m"), built->start.orientation}};
    if (waypoint.orientation_wxyz_size() > 0) {
      timed.pose.orientation = OrientationOf(waypoint, waypoint_path, problems);
    }
    if (i > 0 && !(timed.t_s > built->trajectory.back().t_s)) {
      problems->push_back({absl::StrCat(waypoint_path, ".t_s"),
                           absl::StrCat(timed.t_s, " s is not after the waypoint before it (",
                                        built->trajectory.back().t_s, " s)")});
    }
    built->trajectory.push_back(timed);
  }
}

ToolModel BuildTool(const v1::Tool& tool, const std::string& path, Problems* problems) {
  ToolModel built;
  built.name = tool.name();
  built.shape = ShapeOf(tool);
  if (const auto* needle = std::get_if<NeedleShape>(&built.shape);
      needle != nullptr && needle->tip_length_m > needle->length_m) {
    problems->push_back({absl::StrCat(path, ".needle.tip_length_m"),
                         absl::StrCat(needle->tip_length_m, " m is longer than the needle (",
                                      needle->length_m, " m)")});
  }
  built.start = {Vec3Of(tool, "position_m"), OrientationOf(tool, path, problems)};
  built.coupling = CouplingOf(tool.coupling());
  if (tool.has_adhesion()) {
    const v1::ToolAdhesion& adhesion = tool.adhesion();
    if (adhesion.has_friction_coefficient())
      built.friction_coefficient = adhesion.friction_coefficient();
    built.strength.normal_pa = adhesion.normal_strength_pa();
    built.strength.shear_pa = adhesion.has_shear_strength_pa() ? adhesion.shear_strength_pa()
                                                               : adhesion.normal_strength_pa();
    if (adhesion.has_work_of_adhesion_j_m2()) {
      built.work_of_adhesion_j_m2 = adhesion.work_of_adhesion_j_m2();
    }
    if (adhesion.has_sticky_length_m()) built.sticky_length_m = adhesion.sticky_length_m();
  }
  BuildTrajectory(tool, path, &built, problems);
  return built;
}

AdhesiveParameters BuildAdhesive(const v1::VirtualAdhesive& adhesive, const std::string& path,
                                 Problems* problems) {
  AdhesiveParameters built;
  built.capture_distance_m = adhesive.capture_distance_m();
  built.release_distance_m = adhesive.has_release_distance_m() ? adhesive.release_distance_m()
                                                               : 1.5 * built.capture_distance_m;
  if (!(built.release_distance_m > built.capture_distance_m)) {
    problems->push_back(
        {absl::StrCat(path, ".release_distance_m"),
         absl::StrCat(built.release_distance_m, " m must be greater than capture_distance_m (",
                      built.capture_distance_m, " m)")});
  }
  built.self_collision = adhesive.self_collision();
  // A strength that is not written is infinite, except that shear follows normal.
  if (adhesive.has_normal_strength_pa()) {
    built.strength.normal_pa = built.strength.shear_pa = adhesive.normal_strength_pa();
  }
  if (adhesive.has_shear_strength_pa()) built.strength.shear_pa = adhesive.shear_strength_pa();
  if (adhesive.has_work_of_adhesion_j_m2()) {
    built.work_of_adhesion_j_m2 = adhesive.work_of_adhesion_j_m2();
  }
  built.ties = adhesive.ties();
  if (adhesive.has_patch_size_m()) built.patch_size_m = adhesive.patch_size_m();
  if (adhesive.has_bell()) {
    built.bell = BellRelease{adhesive.bell().rate_per_s(), adhesive.bell().force_n()};
  }
  if (adhesive.has_friction_coefficient()) {
    built.friction_coefficient = adhesive.friction_coefficient();
  }
  if (adhesive.has_kappa_adh_m()) {
    built.kappa = KappaStrength{adhesive.kappa_adh_m(), NumberOf(adhesive, "dt_ref_s")};
    if (adhesive.has_normal_strength_pa() || adhesive.has_shear_strength_pa()) {
      problems->push_back({absl::StrCat(path, ".kappa_adh_m"),
                           "the strength is given twice: write either kappa_adh_m or "
                           "normal_strength_pa and shear_strength_pa"});
    }
  }
  return built;
}

void BuildEffects(const v1::Scene& scene, Model* model, Problems* problems) {
  for (int i = 0; i < scene.effects_size(); ++i) {
    if (!scene.effects(i).has_virtual_adhesive()) continue;
    const std::string path = absl::StrCat("effects[", i, "].virtual_adhesive");
    if (model->adhesive) {
      problems->push_back({path, "a scene has at most one virtual adhesive"});
      continue;
    }
    model->adhesive = BuildAdhesive(scene.effects(i).virtual_adhesive(), path, problems);
  }
}

// Linearly implicit where a body is elastic inside, unless the scene says otherwise.
Integrator IntegratorOf(const v1::Scene& scene) {
  switch (scene.integration().integrator()) {
    case v1::INTEGRATOR_EXPLICIT:
      return Integrator::kExplicit;
    case v1::INTEGRATOR_IMPLICIT:
      return Integrator::kImplicit;
    case v1::INTEGRATOR_NEWTON:
      return Integrator::kNewton;
    default:
      break;
  }
  for (const v1::Effect& effect : scene.effects()) {
    if (effect.has_elasticity()) return Integrator::kImplicit;
  }
  return Integrator::kExplicit;
}

double TipWidth(const ToolShape& shape) {
  const auto* lancet = std::get_if<LancetShape>(&shape);
  return lancet != nullptr ? lancet->blade_width_m : 2 * std::get<NeedleShape>(shape).radius_m;
}

// A tool touches whole triangles: what is narrower than a cell is felt as wide as one.
void WarnOfWideCells(const v1::Scene& scene, const Model& model, Problems* problems) {
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    const bool is_copy = b > 0 && model.bodies[b - 1].scene_name == body.scene_name;
    if (body.rigid || body.all_fixed || body.tetrahedron_count == 0 || is_copy) continue;
    double volume_m3 = 0;
    for (int t = 0; t < body.tetrahedron_count; ++t) {
      volume_m3 += TetVolume(model.rest_position_m, model.tetrahedra[body.first_tetrahedron + t]);
    }
    const double cell_m = std::cbrt(5 * volume_m3 / body.tetrahedron_count);  // five a cell
    for (int i = 0; i < scene.tools_size(); ++i) {
      const double width_m = TipWidth(model.tools[i].shape);
      if (cell_m <= width_m) continue;
      problems->push_back(
          {absl::StrCat("tools[", i, "]"),
           absl::StrFormat("its tip, %.3g m wide, is narrower than the cells of body '%s', %.3g m: "
                           "it is felt as wide as a cell, and too stiff by about as much; needed "
                           "for its force: cells of an eighth of its width",
                           width_m, body.scene_name, cell_m),
           /*warning=*/true});
    }
  }
}

// A patch holds one vertex of each side: where that has a long way to the next, the patch turns
// about it and swings off. Fixed triangles hold what sticks to them whatever their size.
void WarnOfSmallPatches(const v1::Scene& scene, const Model& model, Problems* problems) {
  if (!model.adhesive || !model.adhesive->patch_size_m) return;
  int effect = 0;
  while (!scene.effects(effect).has_virtual_adhesive()) ++effect;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    const bool is_copy = b > 0 && model.bodies[b - 1].scene_name == body.scene_name;
    if (body.rigid || body.all_fixed || body.triangle_count == 0 || is_copy) continue;
    double edges_m = 0;
    for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
      for (int k = 0; k < 3; ++k) {
        edges_m += (model.rest_position_m[model.triangles[t][(k + 1) % 3]] -
                    model.rest_position_m[model.triangles[t][k]])
                       .norm();
      }
    }
    const double edge_m = edges_m / (3 * body.triangle_count);
    if (edge_m <= 2 * *model.adhesive->patch_size_m) continue;
    problems->push_back(
        {absl::StrCat("effects[", effect, "].virtual_adhesive.patch_size_m"),
         absl::StrFormat("patches of %.3g m on body '%s', of which edges are %.3g m long: a patch "
                         "holds one of its vertices, and may swing off about it; needed: edges no "
                         "longer than twice a patch",
                         *model.adhesive->patch_size_m, body.scene_name, edge_m),
         /*warning=*/true});
  }
}

bool NeedsCompliance(const Model& model) {
  return (model.adhesive && model.adhesive->work_of_adhesion_j_m2) ||
         std::any_of(model.tools.begin(), model.tools.end(),
                     [](const ToolModel& tool) { return tool.work_of_adhesion_j_m2.has_value(); });
}

}  // namespace

void BuildConnectivity(Model* model) {
  const int n = model->particle_count();
  IndexLists neighbours = VertexNeighbours(SortedSides(model->triangles), n);
  model->neighbour_start = std::move(neighbours.start);
  model->neighbours = std::move(neighbours.values);
  IndexLists incident = IncidentTriangles(model->triangles, n);
  model->incident_start = std::move(incident.start);
  model->incident = std::move(incident.values);
}

BuiltModel BuildModel(const v1::Scene& scene, const std::string& directory) {
  BuiltModel built;
  auto model = std::make_shared<Model>();
  model->name = scene.name();
  model->dt_s = 1.0 / NumberOf(scene, "rate_hz");
  model->stability_fraction = NumberOf(scene.integration(), "stability_fraction");
  model->max_substeps = static_cast<int>(NumberOf(scene.integration(), "max_substeps"));
  model->integrator = IntegratorOf(scene);
  model->tolerance = NumberOf(scene.integration(), "tolerance");
  model->max_iterations = static_cast<int>(NumberOf(scene.integration(), "max_iterations"));
  if (scene.has_sleep() && scene.sleep().enabled()) {
    model->sleep = {NumberOf(scene.sleep(), "speed_m_s"), NumberOf(scene.sleep(), "time_s")};
  }
  model->seed =
      scene.has_seed() ? scene.seed() : static_cast<std::uint64_t>(NumberOf(scene, "seed"));
  for (int i = 0; i < scene.bodies_size(); ++i) {
    BuildBody(scene.bodies(i), i, directory, model.get(), &built.problems);
  }
  for (int i = 0; i < scene.tools_size(); ++i) {
    model->tools.push_back(
        BuildTool(scene.tools(i), absl::StrCat("tools[", i, "]"), &built.problems));
  }
  BuildEffects(scene, model.get(), &built.problems);
  if (HasError(built.problems)) return built;
  CheckElasticRegions(scene, *model, &built.problems);
  if (HasError(built.problems)) return built;
  WarnOfWideCells(scene, *model, &built.problems);
  WarnOfSmallPatches(scene, *model, &built.problems);
  BuildConnectivity(model.get());
  model->scene = scene;
  if (NeedsCompliance(*model)) model->compliance_per_pa = CompliancesOf(*model);
  built.model = std::move(model);
  return built;
}

}  // namespace adhesim
