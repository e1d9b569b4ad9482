// Gmsh's formats 2.2 and 4.1, text and binary (Gmsh reference manual, "MSH file format").

#include <absl/container/flat_hash_map.h>
#include <absl/status/status.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <array>
#include <bit>
#include <map>
#include <utility>

#include "core/scene/mesh/mesh_cursor.h"
#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/read_mesh.h"
#include "core/scene/mesh/read_tet_mesh.h"

namespace adhesim {
namespace {

// Element types that are read or passed over, and their numbers of nodes.
constexpr int kTriangle = 2, kTetrahedron = 4;
int NodesOf(std::int64_t type) {
  switch (type) {
    case 15:  // point
      return 1;
    case 1:  // line
      return 2;
    case kTriangle:
      return 3;
    case kTetrahedron:
      return 4;
    default:
      return 0;
  }
}

std::string NotRead(std::int64_t type) {
  const char* name = type == 3   ? "a quadrangle"
                     : type == 5 ? "a hexahedron"
                     : type == 6 ? "a prism"
                     : type == 7 ? "a pyramid"
                                 : "an element of higher order (write the mesh with order 1)";
  return absl::StrCat("type ", type, " is ", name,
                      "; permitted: 4 (tetrahedron), beside 15, 1 and 2 (point, line, triangle)");
}

class GmshParser {
 public:
  explicit GmshParser(absl::string_view bytes) : in_(bytes) {}

  absl::StatusOr<TetMesh> Run() {
    if (absl::Status s = ParseFormat(); !s.ok()) return s;
    while (true) {
      const absl::string_view name = in_.Word();
      if (name.empty()) break;
      if (name[0] != '$') {
        return in_.Error(
            absl::StrCat("expected a section ($Nodes, $Elements, ...), not ", QuotedWord(name)));
      }
      if (absl::Status s = ParseSection(name); !s.ok()) return s;
    }
    if (!has_nodes_ || !has_elements_) {
      return in_.Error(has_nodes_ ? "the file has no $Elements" : "the file has no $Nodes");
    }
    return TetMeshFromFile(std::move(file_));
  }

 private:
  absl::Status ParseFormat() {
    if (in_.Word() != "$MeshFormat") return in_.Error("a Gmsh file begins with $MeshFormat");
    const absl::string_view version = in_.Word(), type = in_.Word(), size = in_.Word();
    if (version != "2.2" && version != "4.1") {
      return in_.Error(absl::StrCat("format ", QuotedWord(version), "; permitted: 2.2 and 4.1"));
    }
    is_4_ = version == "4.1";
    if ((type != "0" && type != "1") || size != "8") {
      return in_.Error("after the version come 0 (text) or 1 (binary) and 8 (bytes of a number)");
    }
    in_.RestOfLine();
    if (type == "1") {
      in_.SetBinary(std::endian::native == std::endian::big);
      std::int64_t one = 0;
      if (!in_.Whole(4, true, &one)) return in_.Error("the file ends in its header");
      if (one == 0x01000000) {
        in_.SetBinary(std::endian::native != std::endian::big);
      } else if (one != 1) {
        return in_.Error("the mark of the byte order (the number 1) is damaged");
      }
    }
    return Expect("$EndMeshFormat");
  }

  absl::Status Expect(absl::string_view word) {
    const absl::string_view found = in_.Word();
    if (found == word) return absl::OkStatus();
    return in_.Error(absl::StrCat("expected ", word, ", not ", QuotedWord(found)));
  }

  absl::Status ParseSection(absl::string_view name) {
    const std::string end = absl::StrCat("$End", name.substr(1));
    in_.RestOfLine();
    absl::Status status;
    if (name == "$PhysicalNames") {
      status = ParseNames();
    } else if (name == "$Entities" && is_4_) {
      status = ParseEntities();
    } else if (name == "$Nodes" && !has_nodes_) {
      has_nodes_ = true;
      status = is_4_ ? ParseNodes4() : ParseNodes2();
    } else if (name == "$Elements" && !has_elements_) {
      if (!has_nodes_) return in_.Error("$Nodes must come before $Elements");
      has_elements_ = true;
      status = is_4_ ? ParseElements4() : ParseElements2();
    } else if (name == "$Nodes" || name == "$Elements") {
      return in_.Error(absl::StrCat("a second section ", name));
    } else {
      return in_.SkipBehindLine(end) ? absl::OkStatus()
                                     : in_.Error(absl::StrCat(QuotedWord(name), " has no ", end));
    }
    return status.ok() ? Expect(end) : status;
  }

  absl::Status Truncated() const {
    return in_.Error("the data ends here, or is not a (finite) number of its kind");
  }

  // A number of things of which each takes a byte at least, so that a larger one cannot be true.
  absl::Status Count(std::int64_t limit, const char* of_what, std::int64_t* count) {
    if (!in_.Whole(is_4_ ? 8 : 4, true, count)) return Truncated();
    return CheckCount(limit, of_what, *count);
  }
  absl::Status CheckCount(std::int64_t limit, const char* of_what, std::int64_t count) {
    if (count < 0 || count > static_cast<std::int64_t>(in_.left())) {
      return in_.Error(absl::StrCat(count, " ", of_what, " are not possible in the ", in_.left(),
                                    " bytes left"));
    }
    if (count > limit) {
      return in_.Error(absl::StrCat(count, " ", of_what, "; at most ", limit, " are permitted"));
    }
    return absl::OkStatus();
  }
  // Counts of sections in format 2.2, and of names, are text in binary files too.
  absl::Status TextCount(std::int64_t limit, const char* of_what, std::int64_t* count) {
    const absl::string_view word = in_.Word();
    if (!ParseWhole(word, count)) {
      return in_.Error(absl::StrCat(QuotedWord(word), " is not a number of ", of_what,
                                    "; permitted: whole numbers from 0 to ", limit));
    }
    in_.RestOfLine();
    return CheckCount(limit, of_what, *count);
  }

  absl::Status ParseNames() {
    std::int64_t count = 0;
    if (absl::Status s = TextCount(kMaxNames, "names", &count); !s.ok()) return s;
    for (std::int64_t i = 0; i < count; ++i) {
      std::int64_t dimension = 0, tag = 0;
      if (!ParseWhole(in_.Word(), &dimension) || !ParseWhole(in_.Word(), &tag)) {
        return in_.Error("a physical name is: dimension, number, \"name\"");
      }
      absl::string_view name = in_.RestOfLine();
      if (name.size() < 3 || !absl::ConsumePrefix(&name, "\"") ||
          !absl::ConsumeSuffix(&name, "\"")) {
        return in_.Error("a physical name is: dimension, number, \"name\"");
      }
      names_[{dimension, tag}] = std::string(name);
    }
    return absl::OkStatus();
  }

  // Format 4.1 tells the physical groups of the geometry, whose parts the elements name.
  absl::Status ParseEntities() {
    std::array<std::int64_t, 4> counts;
    for (std::int64_t& count : counts) {
      if (absl::Status s = Count(kMaxNames, "entities", &count); !s.ok()) return s;
    }
    for (int dimension = 0; dimension < 4; ++dimension) {
      for (std::int64_t i = 0; i < counts[dimension]; ++i) {
        std::int64_t tag = 0, groups = 0, bounds = 0, number = 0;
        if (!in_.Whole(4, true, &tag)) return Truncated();
        double coordinate = 0;
        for (int k = 0; k < (dimension == 0 ? 3 : 6); ++k) {
          if (!in_.Real(8, &coordinate)) return Truncated();
        }
        if (absl::Status s = Count(kMaxNames, "groups", &groups); !s.ok()) return s;
        for (std::int64_t g = 0; g < groups; ++g) {
          if (!in_.Whole(4, true, &number)) return Truncated();
          if (g == 0) group_of_entity_[{dimension, tag}] = number;
        }
        if (groups > 1 && dimension == 3 && file_.warnings.size() < 10) {
          file_.warnings.push_back(absl::StrCat("volume ", tag, " is in ", groups,
                                                " physical groups; the first counts"));
        }
        if (dimension == 0) continue;
        if (absl::Status s = Count(kMaxNames, "bounds", &bounds); !s.ok()) return s;
        for (std::int64_t b = 0; b < bounds; ++b) {
          if (!in_.Whole(4, true, &number)) return Truncated();
        }
      }
    }
    return absl::OkStatus();
  }

  absl::Status AddNode(std::int64_t tag) {
    const auto number = static_cast<std::int32_t>(node_of_tag_.size());
    if (node_of_tag_.try_emplace(tag, number).second) return absl::OkStatus();
    return in_.Error(absl::StrCat("a second node ", tag));
  }

  absl::Status AddPosition() {
    Vec3 position;
    for (int axis = 0; axis < 3; ++axis) {
      if (!in_.Real(8, &position[axis])) return Truncated();
    }
    file_.nodes.push_back(position);
    return absl::OkStatus();
  }

  absl::Status ParseNodes2() {
    std::int64_t count = 0, tag = 0;
    if (absl::Status s = TextCount(kMaxMeshVertices, "nodes", &count); !s.ok()) return s;
    for (std::int64_t i = 0; i < count; ++i) {
      if (!in_.Whole(4, true, &tag)) return Truncated();
      if (absl::Status s = AddNode(tag); !s.ok()) return s;
      if (absl::Status s = AddPosition(); !s.ok()) return s;
    }
    return absl::OkStatus();
  }

  absl::Status ParseNodes4() {
    std::int64_t blocks = 0, count = 0, ignored = 0;
    if (absl::Status s = Count(kMaxMeshVertices, "blocks of nodes", &blocks); !s.ok()) return s;
    if (absl::Status s = Count(kMaxMeshVertices, "nodes", &count); !s.ok()) return s;
    if (!in_.Whole(8, true, &ignored) || !in_.Whole(8, true, &ignored)) return Truncated();
    for (std::int64_t b = 0; b < blocks; ++b) {
      std::int64_t dimension = 0, parametric = 0, size = 0, tag = 0;
      if (!in_.Whole(4, true, &dimension) || !in_.Whole(4, true, &ignored) ||
          !in_.Whole(4, true, &parametric)) {
        return Truncated();
      }
      if (dimension < 0 || dimension > 3 || parametric < 0 || parametric > 1) {
        return in_.Error("a block of nodes begins with: dimension (0 to 3), entity, 0 or 1");
      }
      const auto left = static_cast<std::int64_t>(kMaxMeshVertices - file_.nodes.size());
      if (absl::Status s = Count(left, "nodes in a block", &size); !s.ok()) return s;
      for (std::int64_t i = 0; i < size; ++i) {
        if (!in_.Whole(8, true, &tag)) return Truncated();
        if (absl::Status s = AddNode(tag); !s.ok()) return s;
      }
      double parameter = 0;
      for (std::int64_t i = 0; i < size; ++i) {
        if (absl::Status s = AddPosition(); !s.ok()) return s;
        for (std::int64_t k = 0; k < dimension * parametric; ++k) {
          if (!in_.Real(8, &parameter)) return Truncated();
        }
      }
    }
    if (count == static_cast<std::int64_t>(file_.nodes.size())) return absl::OkStatus();
    return in_.Error(
        absl::StrCat("the section announces ", count, " nodes and has ", file_.nodes.size()));
  }

  // The position of a group's name in a list, which it joins when it is new; -1: no group.
  std::int32_t GroupNumber(int dimension, std::int64_t tag, std::vector<std::string>* names) {
    if (tag <= 0) return -1;
    const auto [it, is_new] = group_number_.try_emplace({dimension, tag}, names->size());
    if (is_new) {
      const auto name = names_.find({dimension, tag});
      names->push_back(name == names_.end() ? absl::StrCat(tag) : name->second);
    }
    return it->second;
  }

  // The nodes of an element; what it is for depends on its type.
  absl::Status AddElement(std::int64_t number, std::int64_t type, std::int64_t group, int bytes) {
    TetFile::Element element;
    element.number = number;
    element.line = in_.line();
    for (int k = 0; k < NodesOf(type); ++k) {
      std::int64_t tag = 0;
      if (!in_.Whole(bytes, true, &tag)) return Truncated();
      const auto node = node_of_tag_.find(tag);
      if (node == node_of_tag_.end()) {
        return in_.Error(absl::StrCat("element ", number, ": there is no node ", tag));
      }
      element.nodes[k] = node->second;
    }
    if (type == kTetrahedron) {
      if (file_.tetrahedra.size() >= kMaxTetrahedra) {
        return in_.Error(
            absl::StrCat("one tetrahedron more than the ", kMaxTetrahedra, " permitted"));
      }
      element.group = GroupNumber(3, group, &file_.group_names);
      if (element.group >= 0 && group <= INT32_MAX) element.label = static_cast<int>(group);
      file_.tetrahedra.push_back(element);
    } else if (type == kTriangle && group > 0) {
      element.group = GroupNumber(2, group, &file_.surface_names);
      file_.triangles.push_back(element);
    }
    return absl::OkStatus();
  }

  absl::Status ParseElements2() {
    std::int64_t count = 0;
    if (absl::Status s = TextCount(kMaxElements, "elements", &count); !s.ok()) return s;
    for (std::int64_t read = 0; read < count;) {
      // In binary files elements of a kind share a header.
      std::int64_t number = 0, type = 0, follow = 1, tags = 0;
      if (!in_.binary() && !in_.Whole(4, true, &number)) return Truncated();
      if (!in_.Whole(4, true, &type)) return Truncated();
      if (in_.binary() && !in_.Whole(4, true, &follow)) return Truncated();
      if (!in_.Whole(4, true, &tags)) return Truncated();
      if (NodesOf(type) == 0) return in_.Error(NotRead(type));
      if (follow < 1 || follow > count - read || tags < 0 || tags > 100) {
        return in_.Error(absl::StrCat(follow, " elements with ", tags,
                                      " tags each; permitted: 1 to ", count - read,
                                      " elements, 0 to 100 tags"));
      }
      for (std::int64_t i = 0; i < follow; ++i, ++read) {
        if (in_.binary() && !in_.Whole(4, true, &number)) return Truncated();
        std::int64_t group = 0, tag = 0;
        for (std::int64_t k = 0; k < tags; ++k) {
          if (!in_.Whole(4, true, &tag)) return Truncated();
          if (k == 0) group = tag;
        }
        if (absl::Status s = AddElement(number, type, group, 4); !s.ok()) return s;
      }
    }
    return absl::OkStatus();
  }

  absl::Status ParseElements4() {
    std::int64_t blocks = 0, count = 0, ignored = 0, read = 0;
    if (absl::Status s = Count(kMaxElements, "blocks of elements", &blocks); !s.ok()) return s;
    if (absl::Status s = Count(kMaxElements, "elements", &count); !s.ok()) return s;
    if (!in_.Whole(8, true, &ignored) || !in_.Whole(8, true, &ignored)) return Truncated();
    for (std::int64_t b = 0; b < blocks; ++b) {
      std::int64_t dimension = 0, entity = 0, type = 0, size = 0, number = 0;
      if (!in_.Whole(4, true, &dimension) || !in_.Whole(4, true, &entity) ||
          !in_.Whole(4, true, &type)) {
        return Truncated();
      }
      if (NodesOf(type) == 0) return in_.Error(NotRead(type));
      if (absl::Status s = Count(kMaxElements, "elements in a block", &size); !s.ok()) return s;
      const auto group = group_of_entity_.find({dimension, entity});
      for (std::int64_t i = 0; i < size; ++i, ++read) {
        if (!in_.Whole(8, true, &number)) return Truncated();
        const std::int64_t tag = group == group_of_entity_.end() ? 0 : group->second;
        if (absl::Status s = AddElement(number, type, tag, 8); !s.ok()) return s;
      }
    }
    if (count == read) return absl::OkStatus();
    return in_.Error(absl::StrCat("the section announces ", count, " elements and has ", read));
  }

  static constexpr std::int64_t kMaxNames = 1'000'000;
  static constexpr std::int64_t kMaxElements = 4 * std::int64_t{kMaxTetrahedra};
  using DimensionAndTag = std::pair<std::int64_t, std::int64_t>;

  MeshCursor in_;
  bool is_4_ = false;
  bool has_nodes_ = false, has_elements_ = false;
  TetFile file_;
  std::map<DimensionAndTag, std::string> names_;             // of physical groups
  std::map<DimensionAndTag, std::int64_t> group_of_entity_;  // format 4.1
  std::map<DimensionAndTag, std::int32_t> group_number_;
  absl::flat_hash_map<std::int64_t, std::int32_t> node_of_tag_;
};

}  // namespace

absl::StatusOr<TetMesh> ParseGmsh(absl::string_view bytes) { return GmshParser(bytes).Run(); }

}  // namespace adhesim
