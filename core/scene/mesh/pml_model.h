#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// Attributes that the subset gives no meaning (mass="0.1", mode="SURFACE"), as written, in order.
using PmlProperties = std::vector<std::pair<std::string, std::string>>;

// A particle.
struct PmlAtom {
  std::int64_t index = 0;        // its name in the file; unique, not necessarily consecutive
  Vec3 position = Vec3::Zero();  // in the file's own unit
  std::string name;              // may be empty
  PmlProperties properties;

  bool operator==(const PmlAtom&) const = default;
};

enum class PmlCellType {
  kLine,
  kPolyLine,
  kPolyVertex,
  kTriangle,
  kQuad,         // corners in order around it
  kTetrahedron,  // of either handedness
  kWedge,        // one triangle, then the opposite one, in the same order
  kHexahedron,   // one quad, then the opposite one, in the same order
};

// Some atoms that belong together: an element, a face, or a neighbourhood.
struct PmlCell {
  PmlCellType type = PmlCellType::kTriangle;
  std::optional<std::int64_t> index;  // its name in the file; unique; cellRef needs it
  std::string name;                   // may be empty
  PmlProperties properties;
  PmlProperties color;              // attributes of the color element; empty: there is none
  std::vector<std::int32_t> atoms;  // positions in PmlModel::atoms

  bool operator==(const PmlCell&) const = default;
};

// A node of a tree of components: either a multiComponent, which holds further components, or a
// structuralComponent, which holds cells or atoms but not both.
struct PmlComponent {
  bool multi = false;
  std::string name;  // may be empty
  PmlProperties properties;
  std::vector<PmlComponent> components;  // of a multiComponent
  PmlProperties color;                   // attributes of the color element; empty: there is none
  std::vector<std::int32_t> cells;       // positions in PmlModel::cells
  std::vector<std::int32_t> atoms;       // positions in PmlModel::atoms

  bool operator==(const PmlComponent&) const = default;
};

// A physical model in the Physical Model Language, version 0.6 (Promayon, Chabanas, TIMC Grenoble):
// atoms, and components which say what they form. Exclusive components share no cell with each
// other; informative ones name sets for any purpose. docs/pml.md says what is read and written.
struct PmlModel {
  std::string name;  // may be empty
  PmlProperties properties;
  PmlComponent atom_list;  // name, properties and colour of the structuralComponent in `atoms`
  std::vector<PmlAtom> atoms;
  std::vector<PmlCell> cells;               // in the order of the file; components share them
  std::optional<PmlComponent> exclusive;    // a multiComponent
  std::optional<PmlComponent> informative;  // a multiComponent

  bool operator==(const PmlModel&) const = default;
};

// What the file format calls a type of cell ("TRIANGLE"), and how many atoms such a cell has.
struct PmlCellKind {
  PmlCellType type;
  const char* name;
  int min_atoms;
  int max_atoms;
};
inline constexpr int kAnyNumber = std::numeric_limits<int>::max();
inline constexpr PmlCellKind kPmlCellKinds[] = {
    {PmlCellType::kLine, "LINE", 2, 2},
    {PmlCellType::kPolyLine, "POLY_LINE", 2, kAnyNumber},
    {PmlCellType::kPolyVertex, "POLY_VERTEX", 1, kAnyNumber},
    {PmlCellType::kTriangle, "TRIANGLE", 3, 3},
    {PmlCellType::kQuad, "QUAD", 4, 4},
    {PmlCellType::kTetrahedron, "TETRAHEDRON", 4, 4},
    {PmlCellType::kWedge, "WEDGE", 6, 6},
    {PmlCellType::kHexahedron, "HEXAHEDRON", 8, 8},
};
// Listed in the order of PmlCellType.
inline const PmlCellKind& KindOf(PmlCellType type) {
  return kPmlCellKinds[static_cast<std::size_t>(type)];
}

}  // namespace adhesim
