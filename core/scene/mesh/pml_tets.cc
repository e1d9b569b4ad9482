// The tetrahedra of a physical model (docs/pml.md).

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>

#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/pml_model.h"
#include "core/scene/mesh/read_tet_mesh.h"

namespace adhesim {
namespace {

// The position of a name in a list, which it joins when it is new.
std::int32_t NumberOf(const std::string& name, std::vector<std::string>* names) {
  const auto found = std::find(names->begin(), names->end(), name);
  const auto number = static_cast<std::int32_t>(found - names->begin());
  if (found == names->end()) names->push_back(name);
  return number;
}

bool IsSolid(PmlCellType type) {
  return type == PmlCellType::kTetrahedron || type == PmlCellType::kWedge ||
         type == PmlCellType::kHexahedron;
}

class PmlTets {
 public:
  explicit PmlTets(const PmlModel& model) : model_(model), taken_(model.cells.size(), 0) {
    for (const PmlAtom& atom : model.atoms) file_.nodes.push_back(atom.position);
  }

  absl::StatusOr<TetMesh> Run() {
    if (model_.exclusive) {
      if (absl::Status s = TakeTetrahedra(*model_.exclusive); !s.ok()) return s;
    }
    if (file_.tetrahedra.empty()) {
      return absl::InvalidArgumentError(
          "no exclusive structuralComponent has cells of type TETRAHEDRON (a surface is read as "
          "`mesh`)");
    }
    for (const auto* root : {&model_.exclusive, &model_.informative}) {
      if (*root) TakeNodes(**root);
    }
    return TetMeshFromFile(std::move(file_));
  }

 private:
  absl::Status TakeTetrahedra(const PmlComponent& component) {
    for (const PmlComponent& inner : component.components) {
      if (absl::Status s = TakeTetrahedra(inner); !s.ok()) return s;
    }
    for (const std::int32_t position : component.cells) {
      const PmlCell& cell = model_.cells[position];
      if (!IsSolid(cell.type) || taken_[position]) continue;
      taken_[position] = 1;
      TetFile::Element element;
      element.number = cell.index.value_or(position);
      if (cell.type != PmlCellType::kTetrahedron) {
        return absl::InvalidArgumentError(
            absl::StrCat("cell ", element.number, " of component ", QuotedWord(component.name),
                         " is a ", KindOf(cell.type).name, "; permitted: TETRAHEDRON"));
      }
      if (file_.tetrahedra.size() >= kMaxTetrahedra) {
        return absl::InvalidArgumentError(
            absl::StrCat("one tetrahedron more than the ", kMaxTetrahedra, " permitted"));
      }
      std::copy(cell.atoms.begin(), cell.atoms.end(), element.nodes.begin());
      if (!component.name.empty()) element.group = NumberOf(component.name, &file_.group_names);
      file_.tetrahedra.push_back(element);
    }
    return absl::OkStatus();
  }

  // The atoms that a component lists, or those of its faces. A neighbourhood is no part of a body.
  void TakeNodes(const PmlComponent& component) {
    for (const PmlComponent& inner : component.components) TakeNodes(inner);
    if (component.multi || component.name.empty()) return;
    NodeGroup group{component.name, component.atoms};
    for (const std::int32_t position : component.cells) {
      const PmlCell& cell = model_.cells[position];
      if (cell.type != PmlCellType::kTriangle && cell.type != PmlCellType::kQuad) continue;
      group.nodes.insert(group.nodes.end(), cell.atoms.begin(), cell.atoms.end());
    }
    if (!group.nodes.empty()) file_.node_groups.push_back(std::move(group));
  }

  const PmlModel& model_;
  TetFile file_;
  std::vector<std::uint8_t> taken_;  // [#cells]
};

}  // namespace

absl::StatusOr<TetMesh> TetMeshOfPml(const PmlModel& model) { return PmlTets(model).Run(); }

}  // namespace adhesim
