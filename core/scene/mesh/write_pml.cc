#include "core/scene/mesh/write_pml.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <charconv>
#include <iterator>

#include "core/scene/mesh/mesh_text.h"

namespace adhesim {
namespace {

class PmlWriter {
 public:
  explicit PmlWriter(const PmlModel& model)
      : model_(model), is_written_(model.cells.size(), false) {}

  absl::StatusOr<std::string> Write();

 private:
  void WriteAtoms();
  void WriteRoot(const char* element, const std::optional<PmlComponent>& root);
  void WriteComponent(const PmlComponent& component);
  void WriteCell(std::int32_t position);
  void WriteAtomRefs(const std::vector<std::int32_t>& atoms);

  // Attributes and elements that may be absent.
  void Attribute(absl::string_view name, absl::string_view value);
  void Name(const std::string& name);
  void Properties(const PmlProperties& properties);
  void Color(const PmlProperties& color);
  void Fail(absl::string_view what);

  const PmlModel& model_;
  std::vector<bool> is_written_;  // [#cells]
  std::string out_;
  absl::Status status_;
};

void PmlWriter::Fail(absl::string_view what) {
  if (status_.ok()) status_ = absl::InvalidArgumentError(what);
}

void PmlWriter::Attribute(absl::string_view name, absl::string_view value) {
  absl::StrAppend(&out_, " ", name, "=\"");
  for (const char c : value) {
    switch (c) {
      case '&':
        out_ += "&amp;";
        break;
      case '<':
        out_ += "&lt;";
        break;
      case '"':
        out_ += "&quot;";
        break;
      case '\t':  // written as they are, the reader would turn these three into blanks
      case '\n':
      case '\r':
        absl::StrAppend(&out_, "&#", static_cast<int>(c), ";");
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20) {
          Fail(absl::StrCat(name, " ", QuotedWord(value),
                            " holds a control character, which XML does not permit"));
        }
        out_ += c;
    }
  }
  out_ += '"';
}

void PmlWriter::Name(const std::string& name) {
  if (!name.empty()) Attribute("name", name);
}

void PmlWriter::Properties(const PmlProperties& properties) {
  for (const auto& [name, value] : properties) Attribute(name, value);
}

void PmlWriter::Color(const PmlProperties& color) {
  if (color.empty()) return;
  out_ += "<color";
  Properties(color);
  out_ += "/>\n";
}

void PmlWriter::WriteAtoms() {
  out_ += "<atoms>\n<structuralComponent";
  Name(model_.atom_list.name);
  Properties(model_.atom_list.properties);
  out_ += ">\n";
  Color(model_.atom_list.color);
  absl::StrAppend(&out_, "<nrOfStructures value=\"", model_.atoms.size(), "\"/>\n");
  for (const PmlAtom& atom : model_.atoms) {
    absl::StrAppend(&out_, "<atom><atomProperties index=\"", atom.index, "\"");
    Attribute("x", ShortestNumber(atom.position.x()));
    Attribute("y", ShortestNumber(atom.position.y()));
    Attribute("z", ShortestNumber(atom.position.z()));
    Name(atom.name);
    Properties(atom.properties);
    out_ += "/></atom>\n";
  }
  out_ += "</structuralComponent>\n</atoms>\n";
}

void PmlWriter::WriteAtomRefs(const std::vector<std::int32_t>& atoms) {
  for (const std::int32_t atom : atoms) {
    absl::StrAppend(&out_, "<atomRef index=\"", model_.atoms[atom].index, "\"/>");
  }
}

void PmlWriter::WriteCell(std::int32_t position) {
  const PmlCell& cell = model_.cells[position];
  if (is_written_[position]) {
    if (!cell.index) Fail("a cell without index belongs to two components");
    absl::StrAppend(&out_, "<cellRef index=\"", cell.index.value_or(0), "\"/>\n");
    return;
  }
  is_written_[position] = true;
  out_ += "<cell><cellProperties";
  if (cell.index) absl::StrAppend(&out_, " index=\"", *cell.index, "\"");
  Attribute("type", KindOf(cell.type).name);
  Name(cell.name);
  Properties(cell.properties);
  out_ += "/>";
  Color(cell.color);
  absl::StrAppend(&out_, "<nrOfStructures value=\"", cell.atoms.size(), "\"/>");
  WriteAtomRefs(cell.atoms);
  out_ += "</cell>\n";
}

void PmlWriter::WriteComponent(const PmlComponent& component) {
  const char* element = component.multi ? "multiComponent" : "structuralComponent";
  absl::StrAppend(&out_, "<", element);
  Name(component.name);
  Properties(component.properties);
  out_ += ">\n";
  Color(component.color);
  if (!component.multi) {
    absl::StrAppend(&out_, "<nrOfStructures value=\"",
                    component.cells.size() + component.atoms.size(), "\"/>\n");
  }
  for (const PmlComponent& inner : component.components) WriteComponent(inner);
  for (const std::int32_t cell : component.cells) WriteCell(cell);
  WriteAtomRefs(component.atoms);
  absl::StrAppend(&out_, component.atoms.empty() ? "</" : "\n</", element, ">\n");
}

void PmlWriter::WriteRoot(const char* element, const std::optional<PmlComponent>& root) {
  absl::StrAppend(&out_, "<", element, ">\n");
  if (root) WriteComponent(*root);
  absl::StrAppend(&out_, "</", element, ">\n");
}

absl::StatusOr<std::string> PmlWriter::Write() {
  const auto count = [](const std::optional<PmlComponent>& root) {
    return root ? root->components.size() : 0;
  };
  out_ += "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<physicalModel";
  Name(model_.name);
  absl::StrAppend(&out_, " nrOfAtoms=\"", model_.atoms.size(), "\" nrOfExclusiveComponents=\"",
                  count(model_.exclusive), "\" nrOfInformativeComponents=\"",
                  count(model_.informative), "\" nrOfCells=\"", model_.cells.size(), "\"");
  Properties(model_.properties);
  out_ += ">\n";
  WriteAtoms();
  WriteRoot("exclusiveComponents", model_.exclusive);
  WriteRoot("informativeComponents", model_.informative);
  out_ += "</physicalModel>\n";
  if (!status_.ok()) return status_;
  return std::move(out_);
}

}  // namespace

std::string ShortestNumber(double value) {
  char digits[32];
  const std::to_chars_result end = std::to_chars(std::begin(digits), std::end(digits), value);
  return std::string(digits, end.ptr);
}

absl::StatusOr<std::string> WritePml(const PmlModel& model) { return PmlWriter(model).Write(); }

}  // namespace adhesim
