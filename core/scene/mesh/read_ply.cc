#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/mesh/bytes.h"
#include "core/scene/mesh/mesh_formats.h"
#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/read_mesh.h"

namespace adhesim {
namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

// Each type has two names.
constexpr std::array<std::pair<absl::string_view, Type>, 16> kTypeNames = {
    {{"char", Type::kInt8},
     {"int8", Type::kInt8},
     {"uchar", Type::kUint8},
     {"uint8", Type::kUint8},
     {"short", Type::kInt16},
     {"int16", Type::kInt16},
     {"ushort", Type::kUint16},
     {"uint16", Type::kUint16},
     {"int", Type::kInt32},
     {"int32", Type::kInt32},
     {"uint", Type::kUint32},
     {"uint32", Type::kUint32},
     {"float", Type::kFloat},
     {"float32", Type::kFloat},
     {"double", Type::kDouble},
     {"float64", Type::kDouble}}};

bool ParseType(absl::string_view word, Type* type) {
  for (const auto& [name, value] : kTypeNames) {
    if (name != word) continue;
    *type = value;
    return true;
  }
  return false;
}

constexpr std::size_t SizeOf(Type type) {
  switch (type) {
    case Type::kInt8:
    case Type::kUint8:
      return 1;
    case Type::kInt16:
    case Type::kUint16:
      return 2;
    case Type::kDouble:
      return 8;
    default:
      return 4;
  }
}

struct Property {
  std::string name;
  bool is_list = false;
  Type count_type = Type::kUint8;  // of a list's length
  Type type = Type::kFloat;
};

struct Element {
  std::string name;
  std::int64_t count = 0;
  std::vector<Property> properties;
};

enum class Encoding { kText, kLittleEndian, kBigEndian };

struct Header {
  Encoding encoding = Encoding::kText;
  std::vector<Element> elements;
  std::size_t data_position = 0;
};

absl::Status ParseProperty(const LineReader& line, Header* header) {
  const auto& words = line.words();
  Property property;
  property.is_list = words.size() == 5 && words[1] == "list";
  const bool known = property.is_list ? ParseType(words[2], &property.count_type) &&
                                            ParseType(words[3], &property.type)
                                      : words.size() == 3 && ParseType(words[1], &property.type);
  if (!known || header->elements.empty()) return line.Error("not a property of a PLY header");
  property.name = std::string(words.back());
  header->elements.back().properties.push_back(std::move(property));
  return absl::OkStatus();
}

absl::StatusOr<Header> ParseHeader(absl::string_view bytes) {
  Header header;
  LineReader line(bytes, 0);
  if (!line.Next() || line.words()[0] != "ply") {
    return absl::InvalidArgumentError("a PLY file begins with the word ply");
  }
  bool has_format = false;
  while (line.Next()) {
    const auto& words = line.words();
    if (words[0] == "end_header") {
      if (!has_format) return line.Error("the header has no format");
      header.data_position = line.position();
      return header;
    }
    if (words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "format" && words.size() >= 2) {
      has_format = true;
      if (words[1] == "ascii")
        header.encoding = Encoding::kText;
      else if (words[1] == "binary_little_endian")
        header.encoding = Encoding::kLittleEndian;
      else if (words[1] == "binary_big_endian")
        header.encoding = Encoding::kBigEndian;
      else
        return line.Error("the format must be ascii, binary_little_endian or binary_big_endian");
    } else if (words[0] == "element" && words.size() == 3) {
      Element element{std::string(words[1]), 0, {}};
      // Every item takes at least a byte, so that a larger number cannot be true.
      if (!ParseWhole(words[2], &element.count) || element.count < 0 ||
          element.count > static_cast<std::int64_t>(bytes.size())) {
        return line.Error("the number of items is not possible in a file of this length");
      }
      header.elements.push_back(std::move(element));
    } else if (words[0] == "property") {
      if (absl::Status s = ParseProperty(line, &header); !s.ok()) return s;
    } else {
      return line.Error("not a statement of a PLY header");
    }
  }
  return line.Error("the header has no end_header");
}

// Delivers the numbers after the header one by one, text or binary.
class Numbers {
 public:
  Numbers(absl::string_view bytes, const Header& header)
      : bytes_(bytes.substr(std::min(header.data_position, bytes.size()))),
        encoding_(header.encoding),
        text_(bytes_, 0) {}

  // False at the end of the data, and for a word that is not a number. The value may be NaN in
  // binary files.
  bool Next(Type type, double* value) {
    if (encoding_ == Encoding::kText) {
      while (word_ >= text_.words().size()) {
        if (!text_.Next()) return false;
        word_ = 0;
      }
      return ParseNumber(text_.words()[word_++], value);
    }
    if (bytes_.size() - position_ < SizeOf(type)) return false;
    *value = Load(type, encoding_ == Encoding::kBigEndian);
    position_ += SizeOf(type);
    return true;
  }

 private:
  double Load(Type type, bool big) const {
    switch (type) {
      case Type::kInt8:
        return LoadNumber<std::int8_t>(bytes_, position_, big);
      case Type::kUint8:
        return LoadNumber<std::uint8_t>(bytes_, position_, big);
      case Type::kInt16:
        return LoadNumber<std::int16_t>(bytes_, position_, big);
      case Type::kUint16:
        return LoadNumber<std::uint16_t>(bytes_, position_, big);
      case Type::kInt32:
        return LoadNumber<std::int32_t>(bytes_, position_, big);
      case Type::kUint32:
        return LoadNumber<std::uint32_t>(bytes_, position_, big);
      case Type::kFloat:
        return LoadNumber<float>(bytes_, position_, big);
      case Type::kDouble:
        return LoadNumber<double>(bytes_, position_, big);
    }
    return 0;
  }

  absl::string_view bytes_;
  Encoding encoding_;
  std::size_t position_ = 0;
  LineReader text_;
  std::size_t word_ = 0;
};

// One item of an element: the values of each property (one, or a list's).
absl::Status ReadItem(const Element& element, std::int64_t item, Numbers* numbers,
                      std::vector<std::vector<double>>* values) {
  const auto error = [&](absl::string_view what) {
    return absl::InvalidArgumentError(
        absl::StrCat(element.name, " ", item, " (counted from 0): ", what));
  };
  values->resize(element.properties.size());
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    const Property& property = element.properties[p];
    double count = 1;
    if (property.is_list && !numbers->Next(property.count_type, &count)) {
      return error("the data ends here, or is not a number");
    }
    std::vector<double>& list = (*values)[p];
    list.clear();
    // Grows with what is there, not with what is promised.
    for (double k = 0; k < count; ++k) {
      double value = 0;
      if (!numbers->Next(property.type, &value)) {
        return error("the data ends here, or is not a finite number");
      }
      list.push_back(value);
    }
  }
  return absl::OkStatus();
}

// The column of a property; -1 when there is none.
int Column(const Element& element, absl::string_view name, bool is_list) {
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    if (element.properties[p].name == name && element.properties[p].is_list == is_list) {
      return static_cast<int>(p);
    }
  }
  return -1;
}

// A corner that is a whole number in range of int64; -1, which is refused later, otherwise.
std::int64_t CornerOf(double value) {
  return value >= 0 && value < 4294967296.0 && value == std::floor(value)
             ? static_cast<std::int64_t>(value)
             : -1;
}

absl::Status ReadElement(const Element& element, Numbers* numbers, TriangleMesh* mesh,
                         std::vector<std::vector<std::int64_t>>* faces) {
  if (element.properties.empty()) return absl::OkStatus();  // takes no data
  const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
  const std::array<int, 3> xyz = {Column(element, "x", false), Column(element, "y", false),
                                  Column(element, "z", false)};
  if (is_vertex && (xyz[0] < 0 || xyz[1] < 0 || xyz[2] < 0)) {
    return absl::InvalidArgumentError("the vertices have no properties x, y and z");
  }
  int list = Column(element, "vertex_indices", true);
  if (list < 0) list = Column(element, "vertex_index", true);
  if (is_face && list < 0) {
    return absl::InvalidArgumentError("the faces have no list vertex_indices or vertex_index");
  }
  std::vector<std::vector<double>> values;
  for (std::int64_t item = 0; item < element.count; ++item) {
    if (absl::Status s = ReadItem(element, item, numbers, &values); !s.ok()) return s;
    if (absl::Status s = CheckSize(mesh->vertices.size(), faces->size()); !s.ok()) return s;
    if (is_vertex) {
      mesh->vertices.emplace_back(values[xyz[0]][0], values[xyz[1]][0], values[xyz[2]][0]);
      if (!mesh->vertices.back().allFinite()) {
        return absl::InvalidArgumentError(
            absl::StrCat("vertex ", item, " (counted from 0): coordinate is not a finite number"));
      }
    } else if (is_face) {
      faces->emplace_back();
      for (const double value : values[list]) faces->back().push_back(CornerOf(value));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<TriangleMesh> ParsePly(absl::string_view bytes) {
  const absl::StatusOr<Header> header = ParseHeader(bytes);
  if (!header.ok()) return header.status();
  TriangleMesh mesh;
  std::vector<std::vector<std::int64_t>> faces;
  Numbers numbers(bytes, *header);
  for (const Element& element : header->elements) {
    if (absl::Status s = ReadElement(element, &numbers, &mesh, &faces); !s.ok()) return s;
  }
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (absl::Status s = AddPolygon(faces[f], mesh.vertices.size(), &mesh); !s.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("face ", f, " (counted from 0): ", s.message()));
    }
  }
  return mesh;
}

}  // namespace adhesim
