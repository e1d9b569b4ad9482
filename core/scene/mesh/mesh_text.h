#pragma once

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// Walks over the lines of a text that have at least one word, dropping comments.
class LineReader {
 public:
  // `comment`: the character after which the rest of a line is ignored; 0: none.
  explicit LineReader(absl::string_view text, char comment) : text_(text), comment_(comment) {}

  // Moves to the next line with words; false at the end.
  bool Next();
  const std::vector<absl::string_view>& words() const { return words_; }
  int number() const { return number_; }  // of the current line, from 1
  // The error "line 12: <what>".
  absl::Status Error(absl::string_view what) const;
  // Where the line after the current one begins.
  std::size_t position() const { return position_; }

 private:
  absl::string_view text_;
  char comment_;
  std::size_t position_ = 0;
  int number_ = 0;
  std::vector<absl::string_view> words_;
};

// A word for an error message: shortened, and without bytes that would upset a terminal.
std::string QuotedWord(absl::string_view word);

// A finite decimal number ("1.5e-3"); false for anything else, NaN and infinity included.
bool ParseNumber(absl::string_view word, double* number);
// A whole number.
bool ParseWhole(absl::string_view word, std::int64_t* number);

// Words [first, first + 3) of the current line as a point.
absl::Status ParsePoint(const LineReader& line, std::size_t first, Vec3* point);

// An error when there are more vertices or faces than are permitted. Readers ask as they go, so
// that a hostile file cannot make them take much more memory than it has bytes.
absl::Status CheckSize(std::size_t vertex_count, std::size_t face_count);

// Cuts a polygon into triangles from its first corner (right for convex ones), after checking its
// corners against the number of vertices. The error says what is wrong but not where.
absl::Status AddPolygon(const std::vector<std::int64_t>& corners, std::size_t vertex_count,
                        TriangleMesh* mesh);

}  // namespace adhesim
