#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include <span>
#include <string>
#include <vector>

#include "core/scene/mesh/pml_model.h"

namespace adhesim {

// The surface that a structuralComponent of a model describes, in the file's own unit: its TRIANGLE
// cells and its QUAD cells, each of these as two triangles; without any, the outside of its
// TETRAHEDRON, WEDGE and HEXAHEDRON cells, that is the faces which only one of them has, turned
// outwards. The vertices are the atoms on it, in the file's order.
//
// `component`: the name of a structuralComponent, exclusive or informative (the first in the file,
// if several have it); empty: the first exclusive one that has such cells.
absl::StatusOr<TriangleMesh> PmlSurface(const PmlModel& model, absl::string_view component);

// A part of a surface that gets a component of its own.
struct PmlPart {
  std::string name;
  std::span<const Triangle> triangles;
};

// The model of a surface: an atom per vertex (index: its number), an exclusive structuralComponent
// of TRIANGLE cells per part, and the informative component "Neighborhoods": a POLY_VERTEX cell per
// atom, first the atom itself, then those joined to it by an edge.
PmlModel PmlOfSurface(const std::string& name, std::span<const Vec3> vertices,
                      std::span<const PmlPart> parts);

}  // namespace adhesim
