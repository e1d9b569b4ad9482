#include "core/scene/yaml_tree.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <map>
#include <sstream>

#include "core/scene/did_you_mean.h"

namespace adhesim {
namespace {

constexpr int kMostLevels = 64;
constexpr int kMostNodes = 1'000'000;
constexpr std::size_t kLongestPathKey = 80;

// Thrown out of the parser, which knows no other way to stop.
struct Refusal {
  YAML::Mark mark;
  std::string message;
};

// Builds the tree from the parser's events.
class TreeBuilder : public YAML::EventHandler {
 public:
  explicit TreeBuilder(YamlTree* tree) : tree_(tree) {}

  void OnDocumentStart(const YAML::Mark& mark) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    Attach(AddNode(YamlNode::Kind::kNull, mark, "", anchor), mark);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    const int index = AddNode(YamlNode::Kind::kScalar, mark, tag, anchor);
    tree_->nodes[index].text = value;
    Attach(index, mark);
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    const bool open = found != anchors_.end() &&
                      std::find(open_.begin(), open_.end(), found->second) != open_.end();
    if (found == anchors_.end() || open)
      throw Refusal{mark, "an alias stands for something that contains it"};
    Count(tree_->nodes[found->second].expanded, mark);
    Attach(found->second, mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value style) override {
    Open(AddNode(YamlNode::Kind::kSequence, mark, tag, anchor), mark);
  }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value style) override {
    Open(AddNode(YamlNode::Kind::kMap, mark, tag, anchor), mark);
  }
  void OnSequenceEnd() override { Close(); }
  void OnMapEnd() override { Close(); }

 private:
  int AddNode(YamlNode::Kind kind, const YAML::Mark& mark, const std::string& tag,
              YAML::anchor_t anchor) {
    // The parser gives "!" to quoted and "?" to plain values.
    if (!tag.empty() && tag != "!" && tag != "?") {
      throw Refusal{mark, absl::StrCat("tags are not permitted, got ", Quoted(tag))};
    }
    Count(1, mark);
    const int index = static_cast<int>(tree_->nodes.size());
    YamlNode node;
    node.kind = kind;
    node.line = mark.line + 1;
    node.column = mark.column + 1;
    tree_->nodes.push_back(std::move(node));
    if (anchor != 0) anchors_[anchor] = index;
    return index;
  }

  void Count(int nodes, const YAML::Mark& mark) {
    expanded_ += nodes;
    if (expanded_ > kMostNodes) {
      throw Refusal{mark, absl::StrCat("more than ", kMostNodes, " values (aliases followed)")};
    }
  }

  void Attach(int index, const YAML::Mark& mark) {
    const int height = tree_->nodes[index].height;
    if (static_cast<int>(open_.size()) + height > kMostLevels) {
      throw Refusal{mark, absl::StrCat("more than ", kMostLevels, " levels of nesting")};
    }
    if (open_.empty()) {
      tree_->root = index;
      return;
    }
    YamlNode& parent = tree_->nodes[open_.back()];
    parent.children.push_back(index);
    parent.height = std::max(parent.height, height + 1);
    parent.expanded += tree_->nodes[index].expanded;
  }

  void Open(int index, const YAML::Mark& mark) {
    if (static_cast<int>(open_.size()) >= kMostLevels) {
      throw Refusal{mark, absl::StrCat("more than ", kMostLevels, " levels of nesting")};
    }
    open_.push_back(index);
  }

  void Close() {
    const int index = open_.back();
    open_.pop_back();
    Attach(index, YAML::Mark());
  }

  YamlTree* tree_;
  std::vector<int> open_;                  // containers around the current event, outermost first
  std::map<YAML::anchor_t, int> anchors_;  // node of each anchor
  int expanded_ = 0;
};

Problem ProblemAt(const YAML::Mark& mark, std::string message) {
  return {"", std::move(message), false, std::max(mark.line, 0) + 1, std::max(mark.column, 0) + 1};
}

// True when the indentation of that line (from 0) contains a tab.
bool IndentedByTab(const std::string& text, int line) {
  std::istringstream lines(text);
  std::string content;
  for (int i = 0; i <= line && std::getline(lines, content); ++i) {
  }
  const std::size_t end = content.find_first_not_of(" \t");
  return content.substr(0, end).find('\t') != std::string::npos;
}

// Whether `path` continues with a new part at `at`.
bool EndsPart(absl::string_view path, std::size_t at) {
  return at == path.size() || path[at] == '.' || path[at] == '[';
}

// One level down from `node`: the child that the start of `path` names, which is then removed.
// Null: none.
const YamlNode* Descend(const YamlTree& tree, const YamlNode& node, absl::string_view* path) {
  if (node.kind == YamlNode::Kind::kSequence && absl::StartsWith(*path, "[")) {
    const std::size_t end = path->find(']');
    std::size_t index = 0;
    if (end == absl::string_view::npos || !absl::SimpleAtoi(path->substr(1, end - 1), &index))
      return nullptr;
    if (index >= node.children.size()) return nullptr;
    path->remove_prefix(end + 1);
    return &tree.nodes[node.children[index]];
  }
  if (node.kind != YamlNode::Kind::kMap) return nullptr;
  if (absl::StartsWith(*path, ".")) path->remove_prefix(1);
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const YamlNode& key = tree.nodes[node.children[i]];
    const std::string name = PathKey(key.text);
    if (key.kind != YamlNode::Kind::kScalar || !absl::StartsWith(*path, name)) continue;
    if (!EndsPart(*path, name.size())) continue;
    path->remove_prefix(name.size());
    const YamlNode& value = tree.nodes[node.children[i + 1]];
    if (value.kind == YamlNode::Kind::kNull) return &key;
    return path->empty() && value.kind != YamlNode::Kind::kScalar ? &key : &value;
  }
  return nullptr;
}

}  // namespace

std::string PathKey(absl::string_view key) { return std::string(key.substr(0, kLongestPathKey)); }

const YamlNode* YamlTree::Locate(absl::string_view path) const {
  if (root < 0) return nullptr;
  const YamlNode* node = &nodes[root];
  while (!path.empty()) {
    const YamlNode* child = Descend(*this, *node, &path);
    if (child == nullptr) break;
    node = child;
  }
  return node;
}

std::optional<Problem> ParseYaml(const std::string& text, YamlTree* tree) {
  *tree = YamlTree();
  std::istringstream stream(text);
  try {
    YAML::Parser parser(stream);
    TreeBuilder builder(tree);
    const bool any = parser.HandleNextDocument(builder);
    if (!any || tree->root < 0) {
      tree->nodes.assign(1, YamlNode());
      tree->root = 0;
      return std::nullopt;
    }
    YamlTree second;
    TreeBuilder second_builder(&second);
    if (parser.HandleNextDocument(second_builder)) {
      Problem problem{"", "a second document starts here: a scene is one document"};
      if (second.root >= 0) {
        problem.line = second.nodes[second.root].line;
        problem.column = second.nodes[second.root].column;
      }
      return problem;
    }
  } catch (const Refusal& refusal) {
    return ProblemAt(refusal.mark, refusal.message);
  } catch (const YAML::Exception& error) {
    if (IndentedByTab(text, error.mark.line)) {
      return ProblemAt(error.mark, "not valid YAML: indent with spaces, not with tabs");
    }
    return ProblemAt(error.mark, absl::StrCat("not valid YAML: ", error.msg));
  } catch (const std::exception& error) {
    return Problem{"", absl::StrCat("not valid YAML: ", error.what()), false, 1, 1};
  }
  return std::nullopt;
}

}  // namespace adhesim
