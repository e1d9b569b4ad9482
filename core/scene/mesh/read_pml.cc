#include "core/scene/mesh/read_pml.h"

#include <absl/container/flat_hash_map.h>
#include <absl/status/status.h>
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <expat.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <string>

#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/pml_elements.h"

namespace adhesim {
namespace {

constexpr std::size_t kMaxDepth = 64;         // of elements in each other
constexpr std::size_t kMaxCells = 8'000'000;  // faces, elements and neighbourhoods of the largest
constexpr std::size_t kMaxProperties = 4'000'000;
constexpr std::size_t kMaxComponents = 100'000;
// Indices are whole numbers of 32 bits in the format's own library.
constexpr std::int64_t kMaxIndex = std::numeric_limits<std::int32_t>::max();

// Builds the model while expat walks over the file.
class PmlBuilder {
 public:
  explicit PmlBuilder(XML_Parser parser) : parser_(parser) {
    open_.push_back(PmlElement::kDocument);
  }

  void Start(const char* name, const XML_Char** attributes);
  void End();
  void Text(absl::string_view text);
  // Keeps the first error, with its place, and ends the walk.
  void Fail(absl::string_view what);

  const absl::Status& status() const { return status_; }
  PmlModel Take() { return std::move(model_); }

 private:
  bool Enter(const char* name, PmlElement* element);
  void StartElement(PmlElement element, XmlAttributes& attributes);
  void StartModel(XmlAttributes& attributes);
  void StartComponent(bool multi, XmlAttributes& attributes);
  void StartColor(XmlAttributes& attributes);
  void StartAtom(XmlAttributes& attributes);
  void StartCell();
  void StartCellProperties(XmlAttributes& attributes);
  void StartAtomRef(XmlAttributes& attributes);
  void StartCellRef(XmlAttributes& attributes);
  void EndCell();

  std::string TakeName(XmlAttributes& attributes) { return attributes.Take("name").value_or(""); }
  void KeepRest(XmlAttributes& attributes, PmlProperties* properties);
  void RefuseRest(XmlAttributes& attributes);
  std::optional<std::int64_t> TakeWhole(XmlAttributes& attributes, const char* name);
  bool TakeCoordinate(XmlAttributes& attributes, const char* name, double* coordinate);

  XML_Parser parser_;
  absl::Status status_;
  PmlModel model_;
  std::vector<PmlElement> open_;
  // The structural and multi components that are open, innermost last. Their siblings cannot grow
  // while they are open, so that the pointers stay.
  std::vector<PmlComponent*> components_;
  std::optional<PmlComponent>* root_ = nullptr;  // of the multiComponent that may come next
  absl::flat_hash_map<std::int64_t, std::int32_t> atom_by_index_, cell_by_index_;
  bool has_properties_ = false;  // of the open atom or cell
  bool has_atoms_ = false, has_atom_list_ = false, has_exclusive_ = false, has_informative_ = false;
  std::size_t property_count_ = 0, component_count_ = 0;
};

void PmlBuilder::Fail(absl::string_view what) {
  if (!status_.ok()) return;
  status_ = absl::InvalidArgumentError(
      absl::StrCat("line ", XML_GetCurrentLineNumber(parser_), ", column ",
                   XML_GetCurrentColumnNumber(parser_) + 1, ": ", what));
  XML_StopParser(parser_, XML_FALSE);
}

void PmlBuilder::Text(absl::string_view text) {
  text = absl::StripAsciiWhitespace(text);
  if (text.empty()) return;
  Fail(absl::StrCat("the text ", QuotedWord(text), ": PML says everything in attributes"));
}

void PmlBuilder::Start(const char* name, const XML_Char** pairs) {
  if (!status_.ok()) return;  // expat finishes the element that it stopped at
  PmlElement element;
  if (!Enter(name, &element)) return;
  XmlAttributes attributes(pairs);
  StartElement(element, attributes);
}

bool PmlBuilder::Enter(const char* name, PmlElement* element) {
  if (open_.size() > kMaxDepth) {
    Fail(absl::StrCat("elements nested deeper than ", kMaxDepth));
    return false;
  }
  bool known = false;
  for (const PmlPlace& place : kPmlPlaces) {
    if (place.name != absl::string_view(name)) continue;
    known = true;
    if (place.parents[0] != open_.back() && place.parents[1] != open_.back()) continue;
    *element = place.element;
    open_.push_back(place.element);
    return true;
  }
  Fail(known ? absl::StrCat("<", name, "> does not belong in ", NameOf(open_.back()))
             : absl::StrCat("element ", QuotedWord(name),
                            " is not in the subset of PML 0.6 that is read (docs/pml.md)"));
  return false;
}

void PmlBuilder::StartElement(PmlElement element, XmlAttributes& attributes) {
  switch (element) {
    case PmlElement::kPhysicalModel:
      return StartModel(attributes);
    case PmlElement::kAtoms:
      if (has_atoms_) Fail("a second <atoms>");
      has_atoms_ = true;
      return RefuseRest(attributes);
    case PmlElement::kExclusive:
      if (!has_atoms_) Fail("<exclusiveComponents> before <atoms>");
      if (has_exclusive_) Fail("a second <exclusiveComponents>");
      has_exclusive_ = true;
      root_ = &model_.exclusive;
      return RefuseRest(attributes);
    case PmlElement::kInformative:
      if (!has_atoms_) Fail("<informativeComponents> before <atoms>");
      if (has_informative_) Fail("a second <informativeComponents>");
      has_informative_ = true;
      root_ = &model_.informative;
      return RefuseRest(attributes);
    case PmlElement::kMulti:
    case PmlElement::kStructural:
      return StartComponent(element == PmlElement::kMulti, attributes);
    case PmlElement::kCount:
      // The counts of files in circulation are wrong often enough to be neither used nor demanded.
      TakeWhole(attributes, "value");
      return RefuseRest(attributes);
    case PmlElement::kColor:
      return StartColor(attributes);
    case PmlElement::kAtom:
      if (open_[open_.size() - 3] != PmlElement::kAtoms) Fail("<atom> belongs in <atoms>");
      has_properties_ = false;
      return RefuseRest(attributes);
    case PmlElement::kAtomProperties:
      return StartAtom(attributes);
    case PmlElement::kCell:
      StartCell();
      return RefuseRest(attributes);
    case PmlElement::kCellProperties:
      return StartCellProperties(attributes);
    case PmlElement::kAtomRef:
      return StartAtomRef(attributes);
    case PmlElement::kCellRef:
      return StartCellRef(attributes);
    case PmlElement::kDocument:
      return;
  }
}

void PmlBuilder::End() {
  if (!status_.ok()) return;
  const PmlElement element = open_.back();
  open_.pop_back();
  switch (element) {
    case PmlElement::kMulti:
    case PmlElement::kStructural:
      components_.pop_back();
      break;
    case PmlElement::kAtom:
      if (!has_properties_) Fail("an <atom> without <atomProperties>");
      break;
    case PmlElement::kCell:
      EndCell();
      break;
    case PmlElement::kPhysicalModel:
      if (!has_atoms_) Fail("a physicalModel without <atoms>");
      break;
    default:
      break;
  }
}

void PmlBuilder::StartModel(XmlAttributes& attributes) {
  model_.name = TakeName(attributes);
  for (const char* count :
       {"nrOfAtoms", "nrOfExclusiveComponents", "nrOfInformativeComponents", "nrOfCells"}) {
    TakeWhole(attributes, count);
  }
  KeepRest(attributes, &model_.properties);
}

void PmlBuilder::StartComponent(bool multi, XmlAttributes& attributes) {
  if (++component_count_ > kMaxComponents) {
    return Fail(absl::StrCat("more than ", kMaxComponents, " components"));
  }
  PmlComponent* component = nullptr;
  const PmlElement parent = open_[open_.size() - 2];
  if (parent == PmlElement::kAtoms) {
    if (has_atom_list_) return Fail("a second structuralComponent in <atoms>");
    has_atom_list_ = true;
    component = &model_.atom_list;
  } else if (parent == PmlElement::kMulti) {
    component = &components_.back()->components.emplace_back();
  } else {
    if (root_->has_value()) {
      return Fail(absl::StrCat("a second multiComponent in <", NameOf(parent), ">"));
    }
    component = &root_->emplace();
  }
  component->multi = multi;
  component->name = TakeName(attributes);
  KeepRest(attributes, &component->properties);
  components_.push_back(component);
}

void PmlBuilder::StartColor(XmlAttributes& attributes) {
  PmlProperties* color = open_[open_.size() - 2] == PmlElement::kCell ? &model_.cells.back().color
                                                                      : &components_.back()->color;
  if (!color->empty()) return Fail("a second <color>");
  if (attributes.left().empty()) return Fail("a <color> without r, g, b and a");
  KeepRest(attributes, color);
}

void PmlBuilder::StartAtom(XmlAttributes& attributes) {
  if (has_properties_) return Fail("a second <atomProperties>");
  has_properties_ = true;
  PmlAtom atom;
  const std::optional<std::int64_t> index = TakeWhole(attributes, "index");
  if (!status_.ok()) return;
  if (!index) return Fail("an atom without index");
  if (!TakeCoordinate(attributes, "x", &atom.position.x()) ||
      !TakeCoordinate(attributes, "y", &atom.position.y()) ||
      !TakeCoordinate(attributes, "z", &atom.position.z())) {
    return;
  }
  atom.index = *index;
  atom.name = TakeName(attributes);
  KeepRest(attributes, &atom.properties);
  const auto position = static_cast<std::int32_t>(model_.atoms.size());
  if (!atom_by_index_.emplace(*index, position).second) {
    return Fail(absl::StrCat("a second atom of index ", *index));
  }
  model_.atoms.push_back(std::move(atom));
  if (absl::Status s = CheckSize(model_.atoms.size(), 0); !s.ok()) Fail(s.message());
}

void PmlBuilder::StartCell() {
  if (open_[open_.size() - 3] == PmlElement::kAtoms)
    return Fail("<cell> does not belong in <atoms>");
  if (!components_.back()->atoms.empty()) {
    return Fail("a structuralComponent holds either atoms or cells");
  }
  if (model_.cells.size() >= kMaxCells) {
    return Fail(absl::StrCat("more than ", kMaxCells, " cells"));
  }
  has_properties_ = false;
  components_.back()->cells.push_back(static_cast<std::int32_t>(model_.cells.size()));
  model_.cells.emplace_back();
}

void PmlBuilder::StartCellProperties(XmlAttributes& attributes) {
  if (has_properties_) return Fail("a second <cellProperties>");
  has_properties_ = true;
  PmlCell& cell = model_.cells.back();
  const std::string type = attributes.Take("type").value_or("");
  const PmlCellKind* kind = std::find_if(std::begin(kPmlCellKinds), std::end(kPmlCellKinds),
                                         [&](const PmlCellKind& k) { return k.name == type; });
  if (kind == std::end(kPmlCellKinds)) {
    std::string known;
    for (const PmlCellKind& k : kPmlCellKinds) {
      absl::StrAppend(&known, known.empty() ? "" : ", ", k.name);
    }
    return Fail(absl::StrCat("a cell of type ", QuotedWord(type), "; permitted: ", known));
  }
  cell.type = kind->type;
  cell.index = TakeWhole(attributes, "index");
  cell.name = TakeName(attributes);
  KeepRest(attributes, &cell.properties);
  const auto position = static_cast<std::int32_t>(model_.cells.size() - 1);
  if (cell.index && !cell_by_index_.emplace(*cell.index, position).second) {
    Fail(absl::StrCat("a second cell of index ", *cell.index));
  }
}

void PmlBuilder::EndCell() {
  if (!has_properties_) return Fail("a <cell> without <cellProperties>");
  const PmlCell& cell = model_.cells.back();
  const PmlCellKind& kind = KindOf(cell.type);
  const std::size_t count = cell.atoms.size();
  if (count >= static_cast<std::size_t>(kind.min_atoms) &&
      count <= static_cast<std::size_t>(kind.max_atoms)) {
    return;
  }
  Fail(absl::StrCat("a ", kind.name, " of ", count, " atoms; it has ",
                    kind.max_atoms == kind.min_atoms ? "" : "at least ", kind.min_atoms));
}

void PmlBuilder::StartAtomRef(XmlAttributes& attributes) {
  const std::optional<std::int64_t> index = TakeWhole(attributes, "index");
  RefuseRest(attributes);
  if (!status_.ok()) return;
  if (!index) return Fail("an <atomRef> without index");
  const auto found = atom_by_index_.find(*index);
  if (found == atom_by_index_.end()) return Fail(absl::StrCat("there is no atom ", *index));
  if (open_[open_.size() - 2] == PmlElement::kCell) {
    model_.cells.back().atoms.push_back(found->second);
    return;
  }
  if (open_[open_.size() - 3] == PmlElement::kAtoms) {
    return Fail("<atomRef> does not belong in <atoms>");
  }
  PmlComponent& component = *components_.back();
  if (!component.cells.empty()) return Fail("a structuralComponent holds either atoms or cells");
  component.atoms.push_back(found->second);
}

void PmlBuilder::StartCellRef(XmlAttributes& attributes) {
  const std::optional<std::int64_t> index = TakeWhole(attributes, "index");
  RefuseRest(attributes);
  if (!status_.ok()) return;
  if (!index) return Fail("a <cellRef> without index");
  const auto found = cell_by_index_.find(*index);
  if (found == cell_by_index_.end()) {
    return Fail(absl::StrCat("there is no cell ", *index, " before this place"));
  }
  PmlComponent& component = *components_.back();
  if (!component.atoms.empty()) return Fail("a structuralComponent holds either atoms or cells");
  component.cells.push_back(found->second);
}

void PmlBuilder::KeepRest(XmlAttributes& attributes, PmlProperties* properties) {
  property_count_ += attributes.left().size();
  if (property_count_ > kMaxProperties) {
    return Fail(absl::StrCat("more than ", kMaxProperties, " attributes without a meaning here"));
  }
  *properties = std::move(attributes.left());
}

void PmlBuilder::RefuseRest(XmlAttributes& attributes) {
  if (attributes.left().empty()) return;
  Fail(absl::StrCat("<", NameOf(open_.back()), "> has no attribute ",
                    QuotedWord(attributes.left()[0].first)));
}

std::optional<std::int64_t> PmlBuilder::TakeWhole(XmlAttributes& attributes, const char* name) {
  const std::optional<std::string> text = attributes.Take(name);
  if (!text) return std::nullopt;
  std::int64_t number = 0;
  if (!ParseWhole(absl::StripAsciiWhitespace(*text), &number) || number < 0 || number > kMaxIndex) {
    Fail(
        absl::StrCat(name, " ", QuotedWord(*text), " is not a whole number from 0 to ", kMaxIndex));
  }
  return number;
}

bool PmlBuilder::TakeCoordinate(XmlAttributes& attributes, const char* name, double* coordinate) {
  const std::optional<std::string> text = attributes.Take(name);
  if (!text) {
    Fail(absl::StrCat("an atom without ", name));
    return false;
  }
  if (ParseNumber(absl::StripAsciiWhitespace(*text), coordinate)) return true;
  Fail(absl::StrCat("coordinate ", name, " ", QuotedWord(*text), " is not a finite number"));
  return false;
}

PmlBuilder& BuilderOf(void* user) { return *static_cast<PmlBuilder*>(user); }

}  // namespace

absl::StatusOr<PmlModel> ParsePml(absl::string_view bytes) {
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(
      XML_ParserCreate(nullptr), &XML_ParserFree);
  if (parser == nullptr) return absl::ResourceExhaustedError("no memory for a reader of XML");
  PmlBuilder builder(parser.get());
  XML_SetUserData(parser.get(), &builder);
  XML_SetElementHandler(
      parser.get(),
      [](void* user, const XML_Char* name, const XML_Char** attributes) {
        BuilderOf(user).Start(name, attributes);
      },
      [](void* user, const XML_Char*) { BuilderOf(user).End(); });
  XML_SetCharacterDataHandler(parser.get(), [](void* user, const XML_Char* text, int length) {
    BuilderOf(user).Text(absl::string_view(text, length));
  });
  // Entities could grow without limit or name files of this machine.
  XML_SetStartDoctypeDeclHandler(
      parser.get(), [](void* user, const XML_Char*, const XML_Char*, const XML_Char*, int) {
        BuilderOf(user).Fail("a document type declaration (<!DOCTYPE>) is not permitted in PML");
      });
  const XML_Status walked =
      XML_Parse(parser.get(), bytes.data(), static_cast<int>(bytes.size()), XML_TRUE);
  if (!builder.status().ok()) return builder.status();
  if (walked != XML_STATUS_OK) {
    builder.Fail(
        absl::StrCat("not well-formed XML: ", XML_ErrorString(XML_GetErrorCode(parser.get()))));
    return builder.status();
  }
  return builder.Take();
}

}  // namespace adhesim
