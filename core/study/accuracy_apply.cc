#include "core/study/accuracy_apply.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <google/protobuf/util/message_differencer.h>

#include <optional>

#include "core/model/rungs.h"
#include "core/scene/quantity.h"

namespace adhesim {
namespace {

constexpr char kIntegration[] = "integration", kRungs[] = "rungs";

absl::Status Refuse(const std::string& why) {
  return absl::FailedPreconditionError(absl::StrCat(why, "; edit the scene by hand"));
}

// The node of a key's value in a map; null: the map has no such key.
const YamlNode* Child(const YamlTree& tree, const YamlNode& map, const std::string& key) {
  if (map.kind != YamlNode::Kind::kMap) return nullptr;
  for (std::size_t i = 0; i + 1 < map.children.size(); i += 2) {
    if (tree.nodes[map.children[i]].text == key) return &tree.nodes[map.children[i + 1]];
  }
  return nullptr;
}

// Where a node begins in the text.
std::size_t Offset(const std::string& text, const YamlNode& node) {
  std::size_t at = 0;
  for (int line = 1; line < node.line; ++line) at = text.find('\n', at) + 1;
  return at + node.column - 1;
}

// Where a line of its own can be put in: before the bodies, behind the numbers that scenes begin
// with.
absl::StatusOr<std::size_t> LineBeforeBodies(const std::string& text, const YamlTree& tree) {
  const YamlNode& root = tree.nodes[tree.root];
  int before = root.children[0];
  for (std::size_t i = 0; i < root.children.size(); i += 2) {
    if (tree.nodes[root.children[i]].text == "bodies") before = root.children[i];
  }
  if (tree.nodes[before].column != 1) return Refuse("the file is not YAML in block style");
  return Offset(text, tree.nodes[before]);
}

// One edit; the tree is that of the text as it is now.
absl::StatusOr<std::string> WithEdit(std::string text, const YamlTree& tree,
                                     const SceneEdit& edit) {
  if (tree.root < 0 || tree.nodes[tree.root].kind != YamlNode::Kind::kMap ||
      tree.nodes[tree.root].children.empty()) {
    return Refuse("the file is no map");
  }
  const YamlNode& root = tree.nodes[tree.root];
  absl::string_view field = edit.path;
  const bool nested = absl::ConsumePrefix(&field, absl::StrCat(kIntegration, "."));
  const std::string key(field);
  const YamlNode* map = nested ? Child(tree, root, kIntegration) : &root;
  if (const YamlNode* value = map == nullptr ? nullptr : Child(tree, *map, key)) {
    if (value->kind != YamlNode::Kind::kScalar) return Refuse(edit.path + " is no plain value");
    const std::size_t at = Offset(text, *value);
    // What stands there may be quoted: then the text at hand is not the value's.
    if (text.compare(at, value->text.size(), value->text) != 0) {
      return Refuse(edit.path + " is written in quotes");
    }
    return text.replace(at, value->text.size(), edit.value);
  }
  const std::string entry = absl::StrCat(key, ": ", edit.value);
  if (nested && map != nullptr) {
    // Before the first of the map's entries, in its style.
    if (map->kind != YamlNode::Kind::kMap || map->children.empty()) {
      return Refuse("integration holds nothing");
    }
    const YamlNode& first = tree.nodes[map->children[0]];
    const std::size_t at = Offset(text, first);
    const std::size_t line = text.rfind('\n', at) + 1;
    const std::string before = text.substr(line, at - line);
    const bool block = absl::StripAsciiWhitespace(before).empty();
    return text.insert(at, block ? absl::StrCat(entry, "\n", before) : absl::StrCat(entry, ", "));
  }
  const absl::StatusOr<std::size_t> at = LineBeforeBodies(text, tree);
  if (!at.ok()) return at.status();
  return text.insert(
      *at, nested ? absl::StrCat(kIntegration, ": {", entry, "}\n") : absl::StrCat(entry, "\n"));
}

// Its lines; none: there are no rungs.
std::string TextOf(const RungsEntry& entry) {
  std::string text;
  ForEachRung(entry.rungs, [&](const std::string& name, const v1::RungError& error) {
    if (text.empty()) text = absl::StrCat(kRungs, ":  # ", entry.comment, "\n");
    absl::StrAppend(&text, "  ", name, ": {");
    if (error.has_force_error()) {
      absl::StrAppend(&text, "force_error: ", NumberText(error.force_error()), ", ");
    }
    absl::StrAppend(&text, "position_error: ", NumberText(error.position_error()), "}\n");
  });
  return text;
}

// With the entry in the place of what the text has of rungs.
absl::StatusOr<std::string> WithRungs(std::string text, const YamlTree& tree,
                                      const RungsEntry& entry) {
  if (tree.root < 0 || tree.nodes[tree.root].children.empty()) return Refuse("the file is no map");
  const std::string lines = TextOf(entry);
  const YamlNode& root = tree.nodes[tree.root];
  for (std::size_t i = 0; i + 1 < root.children.size(); i += 2) {
    const YamlNode& key = tree.nodes[root.children[i]];
    if (key.text != kRungs) continue;
    if (key.column != 1) return Refuse("the file is not YAML in block style");
    // Its line, and those below it that are indented.
    const std::size_t begin = Offset(text, key);
    std::size_t end = begin;
    do {
      end = text.find('\n', end);
      end = end == std::string::npos ? text.size() : end + 1;
    } while (end < text.size() && text[end] == ' ');
    return text.replace(begin, end - begin, lines);
  }
  if (lines.empty()) return text;
  const absl::StatusOr<std::size_t> at = LineBeforeBodies(text, tree);
  if (!at.ok()) return at.status();
  return text.insert(*at, lines);
}

}  // namespace

absl::StatusOr<std::string> TextWithEdits(const SceneFile& file,
                                          const std::vector<SceneEdit>& edits,
                                          const RungsEntry& rungs) {
  absl::StatusOr<v1::Scene> wanted = Edited(file.scene, edits);
  if (!wanted.ok()) return wanted.status();
  wanted->clear_rungs();
  if (rungs.rungs.ByteSizeLong() > 0) *wanted->mutable_rungs() = rungs.rungs;
  std::string text = file.text;
  SceneFile now = ParseScene(text, file.file, file.directory);
  for (const SceneEdit& edit : edits) {
    if (edit.path != "rate_hz" && !edit.path.starts_with(absl::StrCat(kIntegration, "."))) {
      return Refuse(edit.path + " is no setting of the step");
    }
    absl::StatusOr<std::string> edited = WithEdit(std::move(text), now.tree, edit);
    if (!edited.ok()) return edited.status();
    text = *std::move(edited);
    now = ParseScene(text, file.file, file.directory);
  }
  absl::StatusOr<std::string> edited = WithRungs(std::move(text), now.tree, rungs);
  if (!edited.ok()) return edited.status();
  text = *std::move(edited);
  now = ParseScene(text, file.file, file.directory);
  // Whatever the text looked like: it must now say what was wanted.
  if (!now.ok() || !google::protobuf::util::MessageDifferencer::Equals(now.scene, *wanted)) {
    return Refuse("the file is written in a way that cannot be edited safely");
  }
  return text;
}

}  // namespace adhesim
