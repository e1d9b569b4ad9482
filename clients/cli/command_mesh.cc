#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cstdint>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/tet_report.h"
#include "clients/cli/write_pml_file.h"
#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/embed.h"
#include "core/scene/mesh/label_map.h"
#include "core/scene/mesh/pml_surface.h"
#include "core/scene/mesh/read_file.h"
#include "core/scene/mesh/read_mesh.h"
#include "core/scene/mesh/read_surface.h"
#include "core/scene/mesh/read_tet_mesh.h"

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
      "size      area %g, edges %g to %g, smallest angle %.1f deg (in the file's unit; with "
      "--scale in m)\n",
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

struct InfoArguments {
  std::string file;
  std::string component;
  double scale_m = 1;
  int cells = 0;  // 0: a surface stays one
  TissueMaterial material;
  bool json = false;
};

// A surface and, where there are any, the tetrahedra behind it.
struct AnyMesh {
  TriangleMesh surface;
  std::optional<TetMesh> tetrahedra;
};

// The surface of a mesh whose inner nodes come last.
TriangleMesh SurfaceOf(const TetMesh& mesh) {
  std::int32_t last = -1;
  for (const Triangle& t : mesh.surface.triangles) last = std::max({last, t[0], t[1], t[2]});
  const auto& nodes = mesh.surface.vertices;
  return {{nodes.begin(), nodes.begin() + last + 1}, mesh.surface.triangles};
}

void Scale(double scale_m, TriangleMesh* mesh) {
  for (Vec3& v : mesh->vertices) v *= scale_m;
}

absl::StatusOr<AnyMesh> Read(const InfoArguments& arguments) {
  if (IsTetMeshName(arguments.file)) {
    if (arguments.cells > 0) {
      return absl::InvalidArgumentError("--tetrahedra: the file has tetrahedra of its own");
    }
    absl::StatusOr<TetMesh> mesh = ReadTetMesh(arguments.file);
    if (!mesh.ok()) return mesh.status();
    Scale(arguments.scale_m, &mesh->surface);
    return AnyMesh{SurfaceOf(*mesh), *std::move(mesh)};
  }
  AnyMesh any;
  LabelAt label_at;
  if (IsLabelMapName(arguments.file) && arguments.component.empty()) {
    absl::StatusOr<LabelledSurface> labelled = ReadLabelSurface(arguments.file, kLabelParticles);
    if (!labelled.ok()) return labelled.status();
    any.surface = std::move(labelled->surface);
    label_at = std::move(labelled->label_at);
  } else {
    absl::StatusOr<TriangleMesh> surface = ReadMesh(arguments.file, arguments.component);
    if (!surface.ok()) return surface.status();
    any.surface = *std::move(surface);
    Scale(arguments.scale_m, &any.surface);
  }
  if (arguments.cells == 0) return any;
  absl::StatusOr<TetMesh> embedded = EmbedInLattice(any.surface, arguments.cells, label_at);
  if (!embedded.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", arguments.file, "': ", embedded.status().message()));
  }
  any.tetrahedra = *std::move(embedded);
  return any;
}

int Info(const InfoArguments& arguments) {
  const absl::StatusOr<AnyMesh> mesh = Read(arguments);
  if (!mesh.ok()) {
    std::cerr << "error: " << mesh.status().message() << "\n";
    return kExitBadInput;
  }
  const MeshCheck check = CheckMesh(mesh->surface);
  if (arguments.json) {
    Json json = ToJson(arguments.file, check);
    if (mesh->tetrahedra) json["tetrahedra"] = TetsToJson(*mesh->tetrahedra, arguments.material);
    PrintJson(json);
    return kExitOk;
  }
  std::cout << ToText(arguments.file, check);
  if (mesh->tetrahedra) std::cout << TetsToText(*mesh->tetrahedra, arguments.material);
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
};

void AddComponentOption(CLI::App* command, std::string* component) {
  command->add_option("--component", *component,
                      "Of a PML file: the structuralComponent whose cells are the surface");
}

void AddInfoCommand(CLI::App* mesh, int* exit_code) {
  auto arguments = std::make_shared<InfoArguments>();
  CLI::App* info = mesh->add_subcommand(
      "info", "Prints what a mesh is: counts, closed, manifold, oriented, volume, tetrahedra");
  info->add_option("FILE", arguments->file,
                   absl::StrCat(kKindsOfFile, ", or tetrahedra (Gmsh .msh, legacy .vtk)"))
      ->required();
  AddComponentOption(info, &arguments->component);
  info->add_option("--tetrahedra", arguments->cells,
                   "Carries the surface by a lattice of so many cells along its longest extent, as "
                   "a scene's `tetrahedra` does")
      ->type_name("CELLS")
      ->check(CLI::Range(1, 200));
  info->add_option("--scale", arguments->scale_m, "Metres per unit of the file (not label maps)")
      ->type_name("M")
      ->capture_default_str()
      ->check(CLI::Range(1e-9, 1000.0));
  info->add_option("--young", arguments->material.young_modulus_pa,
                   "Tetrahedra: Young's modulus for the stable step")
      ->type_name("PA")
      ->capture_default_str()
      ->check(CLI::Range(1e-9, 1e12));
  info->add_option("--poisson", arguments->material.poisson_ratio, "Its Poisson's ratio")
      ->type_name("NU")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 0.499));
  info->add_option("--density", arguments->material.density_kg_m3, "Its density")
      ->type_name("KG_M3")
      ->capture_default_str()
      ->check(CLI::Range(1e-9, 1e5));
  info->add_flag("--json", arguments->json, "Prints one JSON object");
  info->callback([=] { *exit_code = Info(*arguments); });
}

}  // namespace

void AddMeshCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("mesh", "Looks at mesh files and converts them");
  command->require_subcommand(1);
  auto arguments = std::make_shared<Arguments>();
  AddInfoCommand(command, exit_code);

  CLI::App* convert = command->add_subcommand(
      "convert", "Writes a mesh as PML: its vertices, triangles and neighbourhoods (docs/pml.md)");
  convert->add_option("IN", arguments->file, kKindsOfFile)->required();
  convert->add_option("OUT", arguments->out, "The file to write, .pml")->required();
  AddComponentOption(convert, &arguments->component);
  convert->callback(
      [=] { *exit_code = Convert(arguments->file, arguments->component, arguments->out); });
}

}  // namespace adhesim
