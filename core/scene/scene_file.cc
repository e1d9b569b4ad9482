#include "core/scene/scene_file.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <tuple>
#include <utility>
#include <vector>

#include "core/scene/did_you_mean.h"
#include "core/scene/message_reader.h"
#include "core/scene/text_check.h"
#include "core/scene/validate.h"

namespace adhesim {
namespace {

constexpr std::uintmax_t kMostBytes = std::uintmax_t{4} << 20;
// Columns of a long line that are shown around a mistake.
constexpr std::size_t kShownBefore = 60;
constexpr std::size_t kShownLine = 120;

bool IsContinuation(char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; }

std::vector<absl::string_view> SplitLines(absl::string_view text) {
  std::vector<absl::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    lines.push_back(absl::StripSuffix(text.substr(0, end), "\r"));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

// Bytes of the word or quoted text at `column` (from 0).
std::size_t WordLength(absl::string_view line, std::size_t column) {
  const absl::string_view rest = line.substr(column);
  if (rest.empty()) return 1;
  if (rest[0] == '"' || rest[0] == '\'') {
    const std::size_t close = rest.find(rest[0], 1);
    return close == absl::string_view::npos ? rest.size() : close + 1;
  }
  return std::max<std::size_t>(1, std::min(rest.find_first_of(" \t,:[]{}#"), rest.size()));
}

// The source line and, below, a caret; long lines are cut around it.
std::string Excerpt(absl::string_view line, int line_number, int column) {
  std::size_t at = std::min(static_cast<std::size_t>(std::max(column, 1) - 1), line.size());
  const std::size_t word = WordLength(line, at);
  std::size_t start = at > kShownBefore ? at - kShownBefore : 0;
  while (start > 0 && IsContinuation(line[start])) --start;
  std::size_t end = std::min(start + kShownLine, line.size());
  while (end < line.size() && IsContinuation(line[end])) ++end;

  const std::string number = absl::StrCat(absl::Dec(line_number, absl::kSpacePad5));
  std::string marks;
  for (std::size_t i = start; i < at; ++i) {
    if (!IsContinuation(line[i])) marks += line[i] == '\t' ? '\t' : ' ';
  }
  marks += '^';
  for (std::size_t i = at + 1; i < std::min(at + word, end); ++i) {
    if (!IsContinuation(line[i])) marks += '~';
  }
  return absl::StrCat(number, " | ", line.substr(start, end - start), "\n",
                      std::string(number.size(), ' '), " | ", marks, "\n");
}

// Replaces what could move the cursor or colour the terminal, should a value contain it.
std::string Printable(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  }
  return text;
}

SceneFile Unreadable(std::string file, std::string message) {
  SceneFile result;
  result.file = std::move(file);
  result.problems.push_back({"", std::move(message), false, 1, 1});
  return result;
}

// Reads the tree into the scene and adds what validation finds beyond that.
void ReadTree(SceneFile* result) {
  const YamlTree& tree = result->tree;
  const YamlNode& root = tree.nodes[tree.root];
  if (root.kind != YamlNode::Kind::kMap) {
    const bool empty = root.kind == YamlNode::Kind::kNull;
    result->problems.push_back(
        {"", empty ? "the file is empty: expected a scene" : "expected a mapping (name: value)",
         false, root.line, root.column});
    return;
  }
  MessageReader reader(tree, &result->problems);
  reader.ReadMessage(tree.root, "", &result->scene);
  for (Problem& problem : result->Located(ValidateScene(result->scene))) {
    if (!reader.Repeats(problem)) result->problems.push_back(std::move(problem));
  }
  result->problems = result->Located(std::move(result->problems));
}

}  // namespace

bool AllWarnings(const Problems& problems) {
  return std::all_of(problems.begin(), problems.end(),
                     [](const Problem& problem) { return problem.warning; });
}

bool SceneFile::ok() const { return AllWarnings(problems); }

Problems SceneFile::Located(Problems located) const {
  for (Problem& problem : located) {
    if (problem.line > 0) continue;
    const YamlNode* node = tree.Locate(problem.path);
    problem.line = node == nullptr ? 1 : node->line;
    problem.column = node == nullptr ? 1 : node->column;
  }
  std::stable_sort(located.begin(), located.end(), [](const Problem& a, const Problem& b) {
    return std::tie(a.line, a.column) < std::tie(b.line, b.column);
  });
  return located;
}

std::string SceneFile::Format(const Problems& unsorted, bool colour) const {
  const absl::string_view red = colour ? "\033[1;31m" : "", magenta = colour ? "\033[1;35m" : "";
  const absl::string_view bold = colour ? "\033[1m" : "", plain = colour ? "\033[0m" : "";
  const std::vector<absl::string_view> lines = SplitLines(text);
  std::string out;
  for (const Problem& problem : Located(unsorted)) {
    absl::StrAppend(&out, bold, file, ":", problem.line, ":", problem.column, ": ", plain,
                    problem.warning ? magenta : red,
                    problem.warning ? "warning: " : "error: ", plain, Printable(problem.path),
                    problem.path.empty() ? "" : ": ", Printable(problem.message), "\n");
    if (problem.line < 1 || problem.line > static_cast<int>(lines.size())) continue;
    const absl::string_view line = lines[problem.line - 1];
    // A binary file is not shown.
    if (!CheckText(line)) absl::StrAppend(&out, Excerpt(line, problem.line, problem.column));
  }
  return out;
}

int SceneFile::LineOf(absl::string_view path) const {
  const YamlNode* node = tree.Locate(path);
  return node == nullptr ? 0 : node->line;
}

SceneFile ParseScene(std::string text, const std::string& display_name,
                     const std::string& directory) {
  SceneFile result;
  result.file = display_name;
  result.directory = directory;
  // The byte order mark that some editors write.
  result.text = absl::StartsWith(text, "\xEF\xBB\xBF") ? text.substr(3) : std::move(text);
  std::optional<Problem> problem = CheckText(result.text);
  if (!problem) problem = ParseYaml(result.text, &result.tree);
  if (problem) {
    result.problems.push_back(*std::move(problem));
    return result;
  }
  ReadTree(&result);
  if (!result.scene.has_name())
    result.scene.set_name(std::filesystem::path(display_name).stem().string());
  return result;
}

SceneFile ReadSceneFile(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found)
    return Unreadable(path, "no such file");
  // A pipe or a device could block or never end.
  if (!std::filesystem::is_regular_file(status)) return Unreadable(path, "not a regular file");
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error && size > kMostBytes) {
    return Unreadable(
        path, absl::StrCat("the file has ", size, " bytes; permitted: at most ", kMostBytes));
  }
  std::ifstream stream(path, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (!stream.is_open() || stream.bad()) return Unreadable(path, "cannot be read");
  return ParseScene(std::move(text), path, std::filesystem::path(path).parent_path().string());
}

}  // namespace adhesim
