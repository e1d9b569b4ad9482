#include <absl/strings/str_format.h>

#include <iostream>
#include <memory>
#include <string>

#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/write_pml_file.h"
#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/pml_surface.h"
#include "core/scene/mesh/read_file.h"
#include "core/scene/mesh/read_surface.h"

namespace adhesim {
namespace {

constexpr const char* kKindsOfFile = "OBJ, STL, PLY, OFF or PML file, or a label map (INR, NRRD)";
constexpr int kLabelParticles = 1500;  // about, of the surface around a label map

Json ToJson(const std::string& file, const MeshCheck& check) {
  const MeshReport& r = check.report;
  Json json = {{"file", file},
               {"vertices", r.vertices},
               {"triangles", r.triangles},
               {"edges", r.edges},
               {"components", r.components},
               {"closed", r.closed},
               {"manifold", r.manifold},
               {"oriented", r.oriented},
               {"boundary_edges", r.boundary_edges},
               {"non_manifold_edges", r.non_manifold_edges},
               {"non_manifold_vertices", r.non_manifold_vertices},
               {"inconsistent_edges", r.inconsistent_edges},
               {"degenerate_triangles", r.degenerate_triangles},
               {"duplicate_triangles", r.duplicate_triangles},
               {"unused_vertices", r.unused_vertices},
               {"euler_characteristic", r.euler_characteristic},
               {"area", r.area_m2},
               {"min_edge", r.min_edge_m},
               {"max_edge", r.max_edge_m},
               {"min_angle_deg", r.min_angle_deg}};
  if (r.closed && r.oriented) json["volume"] = r.volume_m3;
  if (r.genus >= 0) json["genus"] = r.genus;
  if (r.vertices > 0) {
    json["box_min"] = {r.box.min.x(), r.box.min.y(), r.box.min.z()};
    json["box_max"] = {r.box.max.x(), r.box.max.y(), r.box.max.z()};
  }
  json["flaws"] = Json::array();
  for (const MeshFlaw& flaw : check.flaws)
    json["flaws"].push_back({{"message", flaw.message}, {"warning", flaw.warning}});
  return json;
}

std::string ToText(const std::string& file, const MeshCheck& check) {
  const MeshReport& r = check.report;
  std::string text = absl::StrFormat("%s: %d vertices, %d triangles, %d edges, %d components\n",
                                     file, r.vertices, r.triangles, r.edges, r.components);
  text += absl::StrFormat("surface   %s, %s, %s\n", r.closed ? "closed" : "open",
                          r.manifold ? "manifold" : "not manifold",
                          r.oriented ? "oriented" : "not oriented");
  text += absl::StrFormat(
      "size      area %g, edges %g to %g, smallest angle %.1f deg (in the file's unit)\n",
      r.area_m2, r.min_edge_m, r.max_edge_m, r.min_angle_deg);
  if (r.closed && r.oriented) text += absl::StrFormat("volume    %g\n", r.volume_m3);
  if (r.vertices > 0) {
    text +=
        absl::StrFormat("box       [%g, %g, %g] to [%g, %g, %g]\n", r.box.min.x(), r.box.min.y(),
                        r.box.min.z(), r.box.max.x(), r.box.max.y(), r.box.max.z());
  }
  for (const MeshFlaw& flaw : check.flaws) {
    text += absl::StrFormat("%s %s\n", flaw.warning ? "warning: " : "flaw:    ", flaw.message);
  }
  return text;
}

int Info(const std::string& file, const std::string& component, bool json) {
  const absl::StatusOr<TriangleMesh> mesh = ReadAnySurface(file, kLabelParticles, component);
  if (!mesh.ok()) {
    std::cerr << "error: " << mesh.status().message() << "\n";
    return kExitBadInput;
  }
  const MeshCheck check = CheckMesh(*mesh);
  if (json) {
    PrintJson(ToJson(file, check));
  } else {
    std::cout << ToText(file, check);
  }
  return kExitOk;
}

int Convert(const std::string& in, const std::string& component, const std::string& out) {
  if (Extension(out) != "pml") {
    std::cerr << "error: '" << out << "': meshes are written as .pml files\n";
    return kExitBadInput;
  }
  const absl::StatusOr<TriangleMesh> mesh = ReadAnySurface(in, kLabelParticles, component);
  if (!mesh.ok()) {
    std::cerr << "error: " << mesh.status().message() << "\n";
    return kExitBadInput;
  }
  const PmlPart surface{component.empty() ? "surface" : component, mesh->triangles};
  return WritePmlFile(PmlOfSurface("", mesh->vertices, {&surface, 1}), out);
}

struct Arguments {
  std::string file;
  std::string out;
  std::string component;
  bool json = false;
};

void AddComponentOption(CLI::App* command, std::string* component) {
  command->add_option("--component", *component,
                      "Of a PML file: the structuralComponent whose cells are the surface");
}

}  // namespace

void AddMeshCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("mesh", "Looks at mesh files and converts them");
  command->require_subcommand(1);
  auto arguments = std::make_shared<Arguments>();
  CLI::App* info = command->add_subcommand(
      "info", "Prints what a mesh is: counts, closed, manifold, oriented, volume");
  info->add_option("FILE", arguments->file, kKindsOfFile)->required();
  AddComponentOption(info, &arguments->component);
  info->add_flag("--json", arguments->json, "Prints one JSON object");
  info->callback(
      [=] { *exit_code = Info(arguments->file, arguments->component, arguments->json); });

  CLI::App* convert = command->add_subcommand(
      "convert", "Writes a mesh as PML: its vertices, triangles and neighbourhoods (docs/pml.md)");
  convert->add_option("IN", arguments->file, kKindsOfFile)->required();
  convert->add_option("OUT", arguments->out, "The file to write, .pml")->required();
  AddComponentOption(convert, &arguments->component);
  convert->callback(
      [=] { *exit_code = Convert(arguments->file, arguments->component, arguments->out); });
}

}  // namespace adhesim
