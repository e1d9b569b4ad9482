#include "core/scene/mesh/mesh_cursor.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "core/scene/mesh/bytes.h"
#include "core/scene/mesh/mesh_text.h"

namespace adhesim {
namespace {

bool IsSpace(char c) { return absl::ascii_isspace(static_cast<unsigned char>(c)); }

}  // namespace

absl::string_view MeshCursor::Word() {
  while (position_ < bytes_.size() && IsSpace(bytes_[position_])) {
    line_ += bytes_[position_++] == '\n';
  }
  const std::size_t start = position_;
  while (position_ < bytes_.size() && !IsSpace(bytes_[position_])) ++position_;
  return bytes_.substr(start, position_ - start);
}

absl::string_view MeshCursor::RestOfLine() {
  const std::size_t end = std::min(bytes_.find('\n', position_), bytes_.size());
  const absl::string_view rest = bytes_.substr(position_, end - position_);
  if (end < bytes_.size()) ++line_;
  position_ = std::min(end + 1, bytes_.size());
  return absl::StripAsciiWhitespace(rest);
}

bool MeshCursor::SkipBehindLine(absl::string_view text) {
  while (left() > 0) {
    if (RestOfLine() == text) return true;
  }
  return false;
}

bool MeshCursor::SkipBytes(std::size_t count) {
  if (count > left()) return false;
  position_ += count;
  return true;
}

bool MeshCursor::Whole(int bytes, bool is_signed, std::int64_t* number) {
  if (!binary_) return ParseWhole(Word(), number);
  if (left() < static_cast<std::size_t>(bytes)) return false;
  const auto load = [&]<typename Signed, typename Unsigned>(Signed, Unsigned) {
    *number = is_signed
                  ? static_cast<std::int64_t>(LoadNumber<Signed>(bytes_, position_, big_endian_))
                  : static_cast<std::int64_t>(LoadNumber<Unsigned>(bytes_, position_, big_endian_));
  };
  switch (bytes) {
    case 1:
      load(std::int8_t{}, std::uint8_t{});
      break;
    case 2:
      load(std::int16_t{}, std::uint16_t{});
      break;
    case 4:
      load(std::int32_t{}, std::uint32_t{});
      break;
    default:
      load(std::int64_t{}, std::uint64_t{});
      break;
  }
  position_ += bytes;
  return true;
}

bool MeshCursor::Real(int bytes, double* number) {
  if (!binary_) return ParseNumber(Word(), number);
  if (left() < static_cast<std::size_t>(bytes)) return false;
  *number = bytes == 4 ? LoadNumber<float>(bytes_, position_, big_endian_)
                       : LoadNumber<double>(bytes_, position_, big_endian_);
  position_ += bytes;
  return std::isfinite(*number);
}

absl::Status MeshCursor::Error(absl::string_view what) const {
  return absl::InvalidArgumentError(binary_ ? absl::StrCat("byte ", position_, ": ", what)
                                            : absl::StrCat("line ", line_, ": ", what));
}

}  // namespace adhesim
