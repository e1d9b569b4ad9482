// Legacy VTK files of unstructured grids, text and binary, of versions 2 to 5 ("VTK File Formats").

#include <absl/status/status.h>
#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/mesh/mesh_cursor.h"
#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/read_mesh.h"
#include "core/scene/mesh/read_tet_mesh.h"

namespace adhesim {
namespace {

struct DataType {
  const char* name;
  int bytes;
  bool is_signed;
  bool is_real;
};
constexpr std::array<DataType, 16> kDataTypes = {{{"unsigned_char", 1, false, false},
                                                  {"char", 1, true, false},
                                                  {"unsigned_short", 2, false, false},
                                                  {"short", 2, true, false},
                                                  {"unsigned_int", 4, false, false},
                                                  {"int", 4, true, false},
                                                  {"unsigned_long", 8, false, false},
                                                  {"long", 8, true, false},
                                                  {"vtkidtype", 4, true, false},
                                                  {"vtktypeint64", 8, true, false},
                                                  {"vtktypeuint64", 8, false, false},
                                                  {"vtktypeint32", 4, true, false},
                                                  {"vtktypeint8", 1, true, false},
                                                  {"vtktypeuint8", 1, false, false},
                                                  {"float", 4, true, true},
                                                  {"double", 8, true, true}}};

const DataType* FindType(absl::string_view name) {
  const std::string lower = absl::AsciiStrToLower(name);
  const auto found = std::find_if(kDataTypes.begin(), kDataTypes.end(),
                                  [&](const DataType& type) { return lower == type.name; });
  return found == kDataTypes.end() ? nullptr : &*found;
}

constexpr int kTetrahedron = 10;
// Points, lines, polygons: passed over.
bool IsFlat(std::int64_t type) { return type >= 1 && type <= 9; }

class VtkParser {
 public:
  explicit VtkParser(absl::string_view bytes) : in_(bytes) {}

  absl::StatusOr<TetMesh> Run() {
    if (absl::Status s = ParseHeader(); !s.ok()) return s;
    while (true) {
      const std::string keyword = absl::AsciiStrToUpper(in_.Word());
      if (keyword.empty()) break;
      if (absl::Status s = ParseSection(keyword); !s.ok()) return s;
    }
    if (file_.nodes.empty()) return in_.Error("the file has no POINTS");
    if (starts_.empty() || types_.empty()) return in_.Error("the file has no CELLS or CELL_TYPES");
    if (absl::Status s = TakeTetrahedra(); !s.ok()) return s;
    return TetMeshFromFile(std::move(file_));
  }

 private:
  absl::Status ParseHeader() {
    if (!absl::StartsWith(in_.RestOfLine(), "# vtk DataFile Version ")) {
      return in_.Error("a legacy VTK file begins with '# vtk DataFile Version'");
    }
    in_.RestOfLine();  // the title
    const std::string encoding = absl::AsciiStrToUpper(in_.RestOfLine());
    if (encoding != "ASCII" && encoding != "BINARY") {
      return in_.Error(absl::StrCat(QuotedWord(encoding), "; permitted: ASCII and BINARY"));
    }
    const bool is_data = absl::AsciiStrToUpper(in_.Word()) == "DATASET";
    const std::string kind = absl::AsciiStrToUpper(in_.Word());
    if (!is_data || kind != "UNSTRUCTURED_GRID") {
      return in_.Error(absl::StrCat("the data set is ", QuotedWord(kind),
                                    "; permitted: DATASET UNSTRUCTURED_GRID"));
    }
    if (encoding == "BINARY") in_.SetBinary(/*big_endian=*/true);
    return absl::OkStatus();
  }

  absl::Status Truncated() const {
    return in_.Error("the data ends here, or is not a (finite) number of its kind");
  }

  // A number in a keyword's line, which is text. Each thing takes a byte at least, so that a larger
  // number cannot be true.
  absl::Status Count(const char* of_what, std::int64_t limit, std::int64_t* count) {
    const absl::string_view word = in_.Word();
    if (!ParseWhole(word, count) || *count < 0 || *count > static_cast<std::int64_t>(in_.left())) {
      return in_.Error(absl::StrCat(QuotedWord(word), " is no possible number of ", of_what,
                                    "; permitted: 0 to ",
                                    std::min<std::int64_t>(limit, in_.left())));
    }
    if (*count <= limit) return absl::OkStatus();
    return in_.Error(absl::StrCat(*count, " ", of_what, "; at most ", limit, " are permitted"));
  }

  absl::Status Type(const DataType** type) {
    const absl::string_view word = in_.Word();
    *type = FindType(word);
    if (*type != nullptr) return absl::OkStatus();
    std::string names;
    for (const DataType& known : kDataTypes) {
      absl::StrAppend(&names, names.empty() ? "" : ", ", known.name);
    }
    return in_.Error(absl::StrCat(QuotedWord(word), " is no type of numbers; permitted: ", names));
  }

  // Passes over so many numbers, or (`values` given) reads them: whole ones.
  absl::Status Numbers(const DataType& type, std::int64_t count,
                       std::vector<std::int64_t>* values = nullptr) {
    for (std::int64_t i = 0; i < count; ++i) {
      std::int64_t whole = 0;
      double real = 0;
      if (type.is_real ? !in_.Real(type.bytes, &real)
                       : !in_.Whole(type.bytes, type.is_signed, &whole)) {
        return Truncated();
      }
      if (values != nullptr) values->push_back(whole);
    }
    return absl::OkStatus();
  }

  absl::Status ParseSection(const std::string& keyword) {
    if (keyword == "POINTS") return ParsePoints();
    if (keyword == "CELLS") return ParseCells();
    if (keyword == "CELL_TYPES") return ParseTypes();
    if (keyword == "CELL_DATA" || keyword == "POINT_DATA") {
      of_cells_ = keyword == "CELL_DATA";
      return Count("data", kMost, &data_count_);
    }
    if (keyword == "SCALARS") return ParseScalars();
    if (keyword == "VECTORS" || keyword == "NORMALS") return SkipArray(3);
    if (keyword == "TENSORS") return SkipArray(9);
    if (keyword == "LOOKUP_TABLE") return SkipColours();
    if (keyword == "FIELD") return ParseField();
    if (keyword == "METADATA") {
      in_.RestOfLine();
      return in_.SkipBehindLine("") ? absl::OkStatus() : in_.Error("METADATA has no end");
    }
    return in_.Error(absl::StrCat(QuotedWord(keyword),
                                  " is not a section that is read: POINTS, CELLS, CELL_TYPES, "
                                  "CELL_DATA, POINT_DATA and their arrays"));
  }

  absl::Status ParsePoints() {
    std::int64_t count = 0;
    const DataType* type = nullptr;
    if (!file_.nodes.empty()) return in_.Error("a second section POINTS");
    if (absl::Status s = Count("points", kMaxMeshVertices, &count); !s.ok()) return s;
    if (absl::Status s = Type(&type); !s.ok()) return s;
    if (!type->is_real) {
      return in_.Error(absl::StrCat("points of type ", type->name, "; permitted: float, double"));
    }
    in_.RestOfLine();
    for (std::int64_t i = 0; i < count; ++i) {
      Vec3 point;
      for (int axis = 0; axis < 3; ++axis) {
        if (!in_.Real(type->bytes, &point[axis])) return Truncated();
      }
      file_.nodes.push_back(point);
    }
    return absl::OkStatus();
  }

  absl::Status ParseCells() {
    std::int64_t count = 0, size = 0;
    if (!starts_.empty()) return in_.Error("a second section CELLS");
    if (absl::Status s = Count("cells", kMost, &count); !s.ok()) return s;
    if (absl::Status s = Count("numbers of cells", kMost, &size); !s.ok()) return s;
    in_.RestOfLine();
    // Version 5 has two arrays, older ones a list in which each cell begins with its length. In
    // binary files only the word OFFSETS tells: as a length it would be 1330005587.
    MeshCursor ahead = in_;
    if (ahead.Word() == "OFFSETS") return ParseOffsets(count, size);
    starts_.push_back(0);
    const DataType& whole = *FindType("int");
    for (std::int64_t i = 0, read = 0; i < count; ++i) {
      std::int64_t corners = 0;
      if (!in_.Whole(4, true, &corners)) return Truncated();
      lines_.push_back(in_.line());
      read += 1 + corners;
      if (corners < 0 || read > size) {
        return in_.Error(absl::StrCat("cell ", i, " (counted from 0) has ", corners,
                                      " corners; the section announces ", size, " numbers"));
      }
      if (absl::Status s = Numbers(whole, corners, &corners_); !s.ok()) return s;
      starts_.push_back(static_cast<std::int64_t>(corners_.size()));
    }
    return absl::OkStatus();
  }

  absl::Status ParseOffsets(std::int64_t offsets, std::int64_t connectivity) {
    const DataType* type = nullptr;
    in_.Word();
    if (absl::Status s = Type(&type); !s.ok()) return s;
    in_.RestOfLine();
    if (absl::Status s = Numbers(*type, offsets, &starts_); !s.ok()) return s;
    if (in_.Word() != "CONNECTIVITY") return in_.Error("expected CONNECTIVITY");
    if (absl::Status s = Type(&type); !s.ok()) return s;
    in_.RestOfLine();
    if (absl::Status s = Numbers(*type, connectivity, &corners_); !s.ok()) return s;
    if (starts_.empty() || starts_[0] != 0 || !std::is_sorted(starts_.begin(), starts_.end()) ||
        starts_.back() != connectivity) {
      return in_.Error("OFFSETS must rise from 0 to the number of CONNECTIVITY");
    }
    return absl::OkStatus();
  }

  absl::Status ParseTypes() {
    std::int64_t count = 0;
    if (!types_.empty()) return in_.Error("a second section CELL_TYPES");
    if (absl::Status s = Count("cell types", kMost, &count); !s.ok()) return s;
    in_.RestOfLine();
    return Numbers(*FindType("int"), count, &types_);
  }

  // An array of the cells with one whole number each is their label, if it is the first.
  absl::Status ParseArray(const DataType& type, std::int64_t components, std::int64_t tuples) {
    const bool is_label = of_cells_ && labels_.empty() && components == 1 && !type.is_real;
    return Numbers(type, components * tuples, is_label ? &labels_ : nullptr);
  }

  absl::Status ParseScalars() {
    in_.Word();  // its name
    const DataType* type = nullptr;
    if (absl::Status s = Type(&type); !s.ok()) return s;
    std::int64_t components = 1;
    const absl::string_view written = in_.RestOfLine();
    if (!written.empty() &&
        (!ParseWhole(written, &components) || components < 1 || components > kMostComponents)) {
      return in_.Error(
          absl::StrCat(QuotedWord(written), " components; permitted: 1 to ", kMostComponents));
    }
    MeshCursor ahead = in_;
    if (absl::AsciiStrToUpper(ahead.Word()) == "LOOKUP_TABLE") {
      in_.Word();
      in_.RestOfLine();
    }
    return ParseArray(*type, components, data_count_);
  }

  absl::Status SkipArray(int components) {
    in_.Word();  // its name
    const DataType* type = nullptr;
    if (absl::Status s = Type(&type); !s.ok()) return s;
    in_.RestOfLine();
    return Numbers(*type, components * data_count_);
  }

  absl::Status SkipColours() {
    std::int64_t count = 0;
    in_.Word();  // its name
    if (absl::Status s = Count("colours", kMost, &count); !s.ok()) return s;
    in_.RestOfLine();
    return Numbers(*FindType(in_.binary() ? "unsigned_char" : "float"), 4 * count);
  }

  absl::Status ParseField() {
    std::int64_t arrays = 0, components = 0, tuples = 0;
    in_.Word();  // its name
    if (absl::Status s = Count("arrays", kMost, &arrays); !s.ok()) return s;
    for (std::int64_t a = 0; a < arrays; ++a) {
      const DataType* type = nullptr;
      absl::string_view name = in_.Word();
      if (name == "METADATA") {  // of the array before
        if (!in_.SkipBehindLine("")) return in_.Error("METADATA has no end");
        name = in_.Word();
      }
      if (absl::Status s = Count("components", kMostComponents, &components); !s.ok()) return s;
      if (absl::Status s = Count("tuples", kMost, &tuples); !s.ok()) return s;
      if (absl::Status s = Type(&type); !s.ok()) return s;
      in_.RestOfLine();
      if (absl::Status s = ParseArray(*type, components, tuples); !s.ok()) return s;
    }
    return absl::OkStatus();
  }

  absl::Status TakeTetrahedra() {
    const std::size_t cells = starts_.size() - 1;
    if (types_.size() != cells) {
      return absl::InvalidArgumentError(
          absl::StrCat(cells, " cells and ", types_.size(), " cell types; needed: as many"));
    }
    if (!labels_.empty() && labels_.size() != cells) {
      return absl::InvalidArgumentError(
          absl::StrCat(cells, " cells and ", labels_.size(), " labels; needed: as many"));
    }
    for (std::size_t c = 0; c < cells; ++c) {
      if (IsFlat(types_[c])) continue;
      const std::int64_t line = lines_.empty() ? 0 : lines_[c];
      const std::string cell = absl::StrCat(line > 0 ? absl::StrCat("line ", line, ": ") : "",
                                            "cell ", c, " (counted from 0): ");
      if (types_[c] != kTetrahedron) {
        return absl::InvalidArgumentError(
            absl::StrCat(cell, "type ", types_[c],
                         "; permitted: 10 (tetrahedron), beside points, lines and polygons"));
      }
      if (starts_[c + 1] - starts_[c] != 4) {
        return absl::InvalidArgumentError(absl::StrCat(
            cell, "a tetrahedron of ", starts_[c + 1] - starts_[c], " corners; permitted: 4"));
      }
      if (file_.tetrahedra.size() >= kMaxTetrahedra) {
        return absl::InvalidArgumentError(
            absl::StrCat(cell, "one tetrahedron more than the ", kMaxTetrahedra, " permitted"));
      }
      TetFile::Element& element = file_.tetrahedra.emplace_back();
      element.number = static_cast<std::int64_t>(c);
      element.line = line;
      std::copy_n(corners_.begin() + starts_[c], 4, element.nodes.begin());
      if (!labels_.empty() && labels_[c] >= 0 && labels_[c] <= INT32_MAX) {
        element.label = static_cast<std::int32_t>(labels_[c]);
      }
    }
    return absl::OkStatus();
  }

  static constexpr std::int64_t kMost = 4 * std::int64_t{kMaxTetrahedra} * 5;
  static constexpr std::int64_t kMostComponents = 100;

  MeshCursor in_;
  TetFile file_;
  std::vector<std::int64_t> starts_;   // [#cells + 1] into corners_
  std::vector<std::int64_t> corners_;  // of cells
  std::vector<std::int64_t> lines_;    // [#cells] where they stand, or none
  std::vector<std::int64_t> types_;    // [#cells]
  std::vector<std::int64_t> labels_;   // [#cells] or none
  bool of_cells_ = false;              // the arrays that follow are the cells'
  std::int64_t data_count_ = 0;
};

}  // namespace

absl::StatusOr<TetMesh> ParseVtk(absl::string_view bytes) { return VtkParser(bytes).Run(); }

}  // namespace adhesim
