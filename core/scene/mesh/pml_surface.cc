#include "core/scene/mesh/pml_surface.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>

#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/topology.h"

namespace adhesim {
namespace {

// The atoms around a face; a triangle has -1 in the last place.
using Face = std::array<std::int32_t, 4>;
std::span<const std::int32_t> Corners(const Face& face) {
  return std::span(face).first(face[3] < 0 ? 3 : 4);
}

// The faces of the volume cells, as corners of the cell.
std::span<const Face> FacesOf(PmlCellType type) {
  static constexpr Face kTetrahedron[] = {
      {0, 1, 2, -1}, {0, 2, 3, -1}, {0, 3, 1, -1}, {1, 3, 2, -1}};
  static constexpr Face kWedge[] = {
      {0, 1, 2, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}};
  static constexpr Face kHexahedron[] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                         {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
  switch (type) {
    case PmlCellType::kTetrahedron:
      return kTetrahedron;
    case PmlCellType::kWedge:
      return kWedge;
    case PmlCellType::kHexahedron:
      return kHexahedron;
    default:
      return {};
  }
}

bool IsFace(PmlCellType type) {
  return type == PmlCellType::kTriangle || type == PmlCellType::kQuad;
}

bool HasSurface(const PmlModel& model, const PmlComponent& component) {
  return std::any_of(component.cells.begin(), component.cells.end(), [&](std::int32_t cell) {
    const PmlCellType type = model.cells[cell].type;
    return IsFace(type) || !FacesOf(type).empty();
  });
}

// The first structuralComponent, depth first, that is wanted.
template <typename Wanted>
const PmlComponent* Find(const PmlComponent& component, const Wanted& wanted) {
  if (!component.multi) return wanted(component) ? &component : nullptr;
  for (const PmlComponent& inner : component.components) {
    if (const PmlComponent* found = Find(inner, wanted); found != nullptr) return found;
  }
  return nullptr;
}

absl::StatusOr<const PmlComponent*> FindComponent(const PmlModel& model, absl::string_view name) {
  std::string names;
  const PmlComponent* found = nullptr;
  const auto wanted = [&](const PmlComponent& component) {
    if (!HasSurface(model, component)) return false;
    absl::StrAppend(&names, names.empty() ? "" : ", ", QuotedWord(component.name));
    return name.empty() || component.name == name;
  };
  if (model.exclusive) found = Find(*model.exclusive, wanted);
  if (found == nullptr && !name.empty() && model.informative) {
    found = Find(*model.informative, wanted);
  }
  if (found != nullptr) return found;
  if (name.empty()) {
    return absl::InvalidArgumentError(
        "no exclusive structuralComponent has cells of type TRIANGLE, QUAD, TETRAHEDRON, WEDGE or "
        "HEXAHEDRON");
  }
  return absl::InvalidArgumentError(
      absl::StrCat("no structuralComponent of faces or volume cells is named ", QuotedWord(name),
                   names.empty() ? "" : "; there are: ", names));
}

Vec3 CentreOf(const PmlModel& model, std::span<const std::int32_t> atoms) {
  Vec3 sum = Vec3::Zero();
  for (const std::int32_t atom : atoms) sum += model.atoms[atom].position;
  return sum / static_cast<double>(atoms.size());
}

// The face turned away from the centre of its cell, which is right for convex cells of either
// handedness.
Face Outwards(const PmlModel& model, Face face, const Vec3& cell_centre) {
  const std::span<const std::int32_t> corners = Corners(face);
  const auto at = [&](std::size_t k) -> const Vec3& { return model.atoms[corners[k]].position; };
  Vec3 area = Vec3::Zero();
  for (std::size_t k = 2; k < corners.size(); ++k) area += AreaVector(at(0), at(k - 1), at(k));
  if (area.dot(CentreOf(model, corners) - cell_centre) < 0) {
    std::reverse(face.begin() + 1, face.begin() + corners.size());
  }
  return face;
}

// The faces of the volume cells that only one cell has.
std::vector<Face> OutsideFaces(const PmlModel& model, const PmlComponent& component) {
  struct Side {
    Face sorted;  // to find the same face of another cell
    Face around;
  };
  std::vector<Side> sides;
  for (const std::int32_t position : component.cells) {
    const PmlCell& cell = model.cells[position];
    for (const Face& corners : FacesOf(cell.type)) {
      Face atoms = corners;
      for (std::int32_t& atom : atoms) atom = atom < 0 ? -1 : cell.atoms[atom];
      Side& side = sides.emplace_back();
      side.sorted = side.around = Outwards(model, atoms, CentreOf(model, cell.atoms));
      std::sort(side.sorted.begin(), side.sorted.end());
    }
  }
  std::stable_sort(sides.begin(), sides.end(),
                   [](const Side& a, const Side& b) { return a.sorted < b.sorted; });
  std::vector<Face> outside;
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t last = first + 1;
    while (last < sides.size() && sides[last].sorted == sides[first].sorted) ++last;
    if (last == first + 1) outside.push_back(sides[first].around);
    first = last;
  }
  return outside;
}

}  // namespace

absl::StatusOr<TriangleMesh> PmlSurface(const PmlModel& model, absl::string_view component) {
  const absl::StatusOr<const PmlComponent*> found = FindComponent(model, component);
  if (!found.ok()) return found.status();
  std::vector<Face> faces;
  for (const std::int32_t position : (*found)->cells) {
    const PmlCell& cell = model.cells[position];
    if (!IsFace(cell.type)) continue;
    Face& face = faces.emplace_back(Face{-1, -1, -1, -1});
    std::copy(cell.atoms.begin(), cell.atoms.end(), face.begin());
  }
  if (faces.empty()) faces = OutsideFaces(model, **found);

  // The atoms on the surface, numbered in the file's order.
  std::vector<std::int32_t> vertex_of(model.atoms.size(), -1);
  for (const Face& face : faces) {
    for (const std::int32_t atom : Corners(face)) vertex_of[atom] = 0;
  }
  TriangleMesh mesh;
  for (std::size_t atom = 0; atom < model.atoms.size(); ++atom) {
    if (vertex_of[atom] < 0) continue;
    vertex_of[atom] = static_cast<std::int32_t>(mesh.vertices.size());
    mesh.vertices.push_back(model.atoms[atom].position);
  }
  for (const Face& face : faces) {
    const std::span<const std::int32_t> corners = Corners(face);
    for (std::size_t k = 2; k < corners.size(); ++k) {
      mesh.triangles.push_back(
          {vertex_of[corners[0]], vertex_of[corners[k - 1]], vertex_of[corners[k]]});
    }
  }
  return mesh;
}

PmlModel PmlOfSurface(const std::string& name, std::span<const Vec3> vertices,
                      std::span<const PmlPart> parts) {
  PmlModel model;
  model.name = name;
  model.atom_list.name = "element list";
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    model.atoms.push_back({static_cast<std::int64_t>(i), vertices[i], "", {}});
  }
  const auto add_cell = [&](PmlCellType type, std::vector<std::int32_t> atoms,
                            PmlComponent* component) {
    component->cells.push_back(static_cast<std::int32_t>(model.cells.size()));
    PmlCell& cell = model.cells.emplace_back();
    cell.type = type;
    cell.index = component->cells.back();
    cell.atoms = std::move(atoms);
  };
  PmlComponent& exclusive = model.exclusive.emplace();
  exclusive.multi = true;
  exclusive.name = "Exclusive Components";
  std::vector<Triangle> triangles;
  for (const PmlPart& part : parts) {
    PmlComponent& component = exclusive.components.emplace_back();
    component.name = part.name;
    for (const auto [a, b, c] : part.triangles) {
      add_cell(PmlCellType::kTriangle, {a, b, c}, &component);
    }
    triangles.insert(triangles.end(), part.triangles.begin(), part.triangles.end());
  }
  PmlComponent& informative = model.informative.emplace();
  informative.multi = true;
  informative.name = "Informative Components";
  PmlComponent& neighbourhoods = informative.components.emplace_back();
  neighbourhoods.name = "Neighborhoods";
  const auto count = static_cast<int>(vertices.size());
  const IndexLists neighbours = VertexNeighbours(SortedSides(triangles), count);
  for (int i = 0; i < count; ++i) {
    std::vector<std::int32_t> atoms = {i};
    atoms.insert(atoms.end(), neighbours.values.begin() + neighbours.start[i],
                 neighbours.values.begin() + neighbours.start[i + 1]);
    add_cell(PmlCellType::kPolyVertex, std::move(atoms), &neighbourhoods);
  }
  return model;
}

}  // namespace adhesim
