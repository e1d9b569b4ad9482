#pragma once

#include <absl/strings/string_view.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>

#include "core/scene/mesh/pml_model.h"

namespace adhesim {

enum class PmlElement {
  kDocument,
  kPhysicalModel,
  kAtoms,
  kExclusive,
  kInformative,
  kMulti,
  kStructural,
  kCount,
  kColor,
  kAtom,
  kAtomProperties,
  kCell,
  kCellProperties,
  kAtomRef,
  kCellRef,
};

// Where an element may stand. A structuralComponent, atom, cell or reference has more to obey,
// which its own code looks after.
struct PmlPlace {
  const char* name;
  PmlElement element;
  std::array<PmlElement, 2> parents;
};
inline constexpr PmlPlace kPmlPlaces[] = {
    {"physicalModel", PmlElement::kPhysicalModel, {PmlElement::kDocument, PmlElement::kDocument}},
    {"atoms", PmlElement::kAtoms, {PmlElement::kPhysicalModel, PmlElement::kPhysicalModel}},
    {"exclusiveComponents",
     PmlElement::kExclusive,
     {PmlElement::kPhysicalModel, PmlElement::kPhysicalModel}},
    {"informativeComponents",
     PmlElement::kInformative,
     {PmlElement::kPhysicalModel, PmlElement::kPhysicalModel}},
    {"multiComponent", PmlElement::kMulti, {PmlElement::kMulti, PmlElement::kMulti}},
    {"multiComponent", PmlElement::kMulti, {PmlElement::kExclusive, PmlElement::kInformative}},
    {"structuralComponent", PmlElement::kStructural, {PmlElement::kAtoms, PmlElement::kMulti}},
    {"nrOfStructures", PmlElement::kCount, {PmlElement::kStructural, PmlElement::kCell}},
    {"color", PmlElement::kColor, {PmlElement::kStructural, PmlElement::kCell}},
    {"atom", PmlElement::kAtom, {PmlElement::kStructural, PmlElement::kStructural}},
    {"atomProperties", PmlElement::kAtomProperties, {PmlElement::kAtom, PmlElement::kAtom}},
    {"cell", PmlElement::kCell, {PmlElement::kStructural, PmlElement::kStructural}},
    {"cellProperties", PmlElement::kCellProperties, {PmlElement::kCell, PmlElement::kCell}},
    {"atomRef", PmlElement::kAtomRef, {PmlElement::kStructural, PmlElement::kCell}},
    {"cellRef", PmlElement::kCellRef, {PmlElement::kStructural, PmlElement::kStructural}},
};

inline const char* NameOf(PmlElement element) {
  for (const PmlPlace& place : kPmlPlaces) {
    if (place.element == element) return place.name;
  }
  return "the document";
}

// The attributes of one element, in the file's order; what is taken is not left over.
class XmlAttributes {
 public:
  explicit XmlAttributes(const char** pairs) {
    for (; *pairs != nullptr; pairs += 2) left_.emplace_back(pairs[0], pairs[1]);
  }
  std::optional<std::string> Take(absl::string_view name) {
    const auto found = std::find_if(left_.begin(), left_.end(),
                                    [&](const auto& pair) { return pair.first == name; });
    if (found == left_.end()) return std::nullopt;
    std::string value = std::move(found->second);
    left_.erase(found);
    return value;
  }
  PmlProperties& left() { return left_; }

 private:
  PmlProperties left_;
};

}  // namespace adhesim
