#include "clients/cli/tet_report.h"

#include <absl/strings/str_format.h>

namespace adhesim {

Json TetsToJson(const TetMesh& mesh, const TissueMaterial& material) {
  const TetReport r = MeasureTets(mesh);
  Json json = {{"nodes", r.nodes},
               {"carried_vertices", r.carried},
               {"tetrahedra", r.tetrahedra},
               {"components", r.components},
               {"volume", r.volume_m3},
               {"filled_volume", r.filled_m3},
               {"min_dihedral_deg", r.min_dihedral_deg},
               {"max_dihedral_deg", r.max_dihedral_deg},
               {"min_radius_ratio", r.min_radius_ratio},
               {"mean_radius_ratio", r.mean_radius_ratio},
               {"min_edge", r.min_edge_m},
               {"stable_step_s", StableStep(mesh, material)},
               {"young_modulus_pa", material.young_modulus_pa},
               {"poisson_ratio", material.poisson_ratio},
               {"density_kg_m3", material.density_kg_m3},
               {"mass_kg", material.density_kg_m3 * r.filled_m3}};
  json["labels"] = json["groups"] = json["surface_groups"] = json["warnings"] = Json::array();
  for (const auto& [label, volume] : r.label_m3) {
    json["labels"].push_back({{"label", label}, {"volume", volume}});
  }
  for (const auto& [name, volume] : r.group_m3) {
    json["groups"].push_back({{"name", name}, {"volume", volume}});
  }
  for (const NodeGroup& group : mesh.node_groups) {
    json["surface_groups"].push_back({{"name", group.name}, {"nodes", group.nodes.size()}});
  }
  for (const std::string& warning : mesh.warnings) json["warnings"].push_back(warning);
  return json;
}

std::string TetsToText(const TetMesh& mesh, const TissueMaterial& material) {
  const TetReport r = MeasureTets(mesh);
  std::string text = absl::StrFormat("inside    %d tetrahedra, %d nodes, %d components",
                                     r.tetrahedra, r.nodes, r.components);
  if (r.carried > 0) text += absl::StrFormat("; they carry %d vertices", r.carried);
  text += absl::StrFormat("\nvolume    %g of tetrahedra, %g of it inside the surface\n",
                          r.volume_m3, r.filled_m3);
  for (const auto& [label, volume] : r.label_m3) {
    text += absl::StrFormat("label     %d: volume %g\n", label, volume);
  }
  for (const auto& [name, volume] : r.group_m3) {
    text += absl::StrFormat("group     %s: volume %g\n", name, volume);
  }
  for (const NodeGroup& group : mesh.node_groups) {
    text += absl::StrFormat("group     %s: %d nodes of the surface\n", group.name,
                            static_cast<int>(group.nodes.size()));
  }
  text += absl::StrFormat(
      "quality   dihedral angles %.1f to %.1f deg, radius ratio from %.3f (mean %.3f; 1: regular), "
      "shortest edge %g\n",
      r.min_dihedral_deg, r.max_dihedral_deg, r.min_radius_ratio, r.mean_radius_ratio,
      r.min_edge_m);
  text += absl::StrFormat(
      "explicit  steps below %g s are stable for E = %g Pa, nu = %g, %g kg/m^3, %g kg in all "
      "(lengths in m; bound by the stiffest tetrahedron)\n",
      StableStep(mesh, material), material.young_modulus_pa, material.poisson_ratio,
      material.density_kg_m3, material.density_kg_m3 * r.filled_m3);
  for (const std::string& warning : mesh.warnings) text += "warning:  " + warning + "\n";
  return text;
}

}  // namespace adhesim
