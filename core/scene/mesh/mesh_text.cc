#include "core/scene/mesh/mesh_text.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "core/scene/mesh/read_mesh.h"

namespace adhesim {
namespace {

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

}  // namespace

std::string QuotedWord(absl::string_view word) {
  constexpr std::size_t kLongest = 40;
  std::string text = "'";
  for (const char c : word.substr(0, kLongest)) text += c >= ' ' && c < 127 ? c : '?';
  return text + (word.size() > kLongest ? "...'" : "'");
}

bool LineReader::Next() {
  while (position_ < text_.size()) {
    const std::size_t end = std::min(text_.find('\n', position_), text_.size());
    absl::string_view line = text_.substr(position_, end - position_);
    position_ = end + 1;
    ++number_;
    if (comment_ != 0) line = line.substr(0, line.find(comment_));
    words_.clear();
    for (std::size_t i = 0; i < line.size();) {
      if (IsBlank(line[i])) {
        ++i;
        continue;
      }
      const std::size_t start = i;
      while (i < line.size() && !IsBlank(line[i])) ++i;
      words_.push_back(line.substr(start, i - start));
    }
    if (!words_.empty()) return true;
  }
  return false;
}

absl::Status LineReader::Error(absl::string_view what) const {
  return absl::InvalidArgumentError(absl::StrCat("line ", number_, ": ", what));
}

bool ParseNumber(absl::string_view word, double* number) {
  // from_chars: independent of the locale; it does not know a leading plus.
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), *number);
  return error == std::errc() && end == word.data() + word.size() && std::isfinite(*number);
}

bool ParseWhole(absl::string_view word, std::int64_t* number) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), *number);
  return error == std::errc() && end == word.data() + word.size();
}

absl::Status ParsePoint(const LineReader& line, std::size_t first, Vec3* point) {
  if (line.words().size() < first + 3) return line.Error("a vertex needs three coordinates");
  for (int axis = 0; axis < 3; ++axis) {
    const absl::string_view word = line.words()[first + axis];
    if (!ParseNumber(word, &(*point)[axis])) {
      return line.Error(absl::StrCat("coordinate ", QuotedWord(word), " is not a finite number"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckSize(std::size_t vertex_count, std::size_t face_count) {
  if (vertex_count > kMaxMeshVertices) {
    return absl::InvalidArgumentError(absl::StrCat("more than ", kMaxMeshVertices, " vertices"));
  }
  if (face_count > kMaxMeshTriangles) {
    return absl::InvalidArgumentError(absl::StrCat("more than ", kMaxMeshTriangles, " triangles"));
  }
  return absl::OkStatus();
}

absl::Status AddPolygon(const std::vector<std::int64_t>& corners, std::size_t vertex_count,
                        TriangleMesh* mesh) {
  if (corners.size() < 3) {
    return absl::InvalidArgumentError(
        absl::StrCat("a face of ", corners.size(), " vertices; at least 3 are needed"));
  }
  for (const std::int64_t corner : corners) {
    if (corner < 0 || corner >= static_cast<std::int64_t>(vertex_count)) {
      return absl::InvalidArgumentError(absl::StrCat("a face names vertex ", corner,
                                                     " (counted from 0); the file has ",
                                                     vertex_count, " vertices"));
    }
  }
  for (std::size_t k = 2; k < corners.size(); ++k) {
    mesh->triangles.push_back({static_cast<std::int32_t>(corners[0]),
                               static_cast<std::int32_t>(corners[k - 1]),
                               static_cast<std::int32_t>(corners[k])});
  }
  return CheckSize(vertex_count, mesh->triangles.size());
}

}  // namespace adhesim
