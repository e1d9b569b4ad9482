#pragma once

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

#include <cstddef>
#include <cstdint>

namespace adhesim {

// Walks through a mesh file whose keywords are text and whose numbers are text or binary.
class MeshCursor {
 public:
  explicit MeshCursor(absl::string_view bytes) : bytes_(bytes) {}

  // From here on numbers are binary.
  void SetBinary(bool big_endian) {
    binary_ = true;
    big_endian_ = big_endian;
  }
  bool binary() const { return binary_; }
  // Of text; 0 in binary files.
  std::int64_t line() const { return binary_ ? 0 : line_; }
  std::size_t left() const { return bytes_.size() - position_; }

  // The next word, on this line or a later one; empty at the end.
  absl::string_view Word();
  // What is left of this line, without blanks at its ends; the next line is then the current one.
  absl::string_view RestOfLine();
  // Moves behind the next line that consists of this text; false when there is none.
  bool SkipBehindLine(absl::string_view text);
  bool SkipBytes(std::size_t count);

  // A whole number (binary: of so many bytes, 1, 2, 4 or 8). False at the end, and for what is no
  // number.
  bool Whole(int bytes, bool is_signed, std::int64_t* number);
  // A finite number (binary: a float or a double).
  bool Real(int bytes, double* number);

  // The error "line 12: <what>", or "byte 340: <what>" of a binary file.
  absl::Status Error(absl::string_view what) const;

 private:
  absl::string_view bytes_;
  std::size_t position_ = 0;
  std::int64_t line_ = 1;
  bool binary_ = false;
  bool big_endian_ = false;
};

}  // namespace adhesim
