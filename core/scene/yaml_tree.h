#pragma once

#include <absl/strings/string_view.h>

#include <optional>
#include <string>
#include <vector>

#include "core/scene/problem.h"

namespace adhesim {

// One value of a YAML document, or the key of one.
struct YamlNode {
  enum class Kind { kNull, kScalar, kSequence, kMap };

  Kind kind = Kind::kNull;
  std::string text;           // of a scalar, unquoted
  std::vector<int> children;  // indices of nodes; of a map: key, value, key, value, ...
  int line = 1;               // from 1
  int column = 1;             // in bytes, from 1
  int height = 1;             // levels below and with this one, aliases followed
  int expanded = 1;           // nodes below and with this one, aliases followed
};

// A YAML (or JSON) document as it was written: repeated keys are kept. An alias is the node that it
// stands for, so a node can have several parents.
struct YamlTree {
  std::vector<YamlNode> nodes;
  int root = -1;

  // The node that a path like "bodies[1].mesh.file" leads to, or the nearest one above it. Where
  // the value is not a scalar, the key says better where it is: then the key's node.
  const YamlNode* Locate(absl::string_view path) const;
};

// A key as it appears in paths: long ones are cut.
std::string PathKey(absl::string_view key);

// Reads one document. Refused, with a single problem: syntax errors, several documents, explicit
// tags, an alias inside what it stands for, more than 64 levels or 10^6 nodes (aliases followed).
// An empty document has a root of kind kNull.
std::optional<Problem> ParseYaml(const std::string& text, YamlTree* tree);

}  // namespace adhesim
