#include "core/scene/text_check.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstdint>

namespace adhesim {
namespace {

constexpr std::size_t kMostBytes = std::size_t{4} << 20;

// Bytes of the UTF-8 character at the start of `text`; 0: none (overlong forms and surrogates are
// none).
std::size_t CharacterLength(absl::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < length) return 0;
  std::uint32_t code = first & (0x7F >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
    code = code << 6 | (byte(i) & 0x3F);
  }
  constexpr std::uint32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  return code < kSmallest[length] || code > 0x10FFFF || surrogate ? 0 : length;
}

}  // namespace

std::optional<Problem> CheckText(absl::string_view text) {
  if (text.size() > kMostBytes) {
    return Problem{
        "", absl::StrCat("the file has ", text.size(), " bytes; permitted: at most ", kMostBytes),
        false, 1, 1};
  }
  int line = 1;
  std::size_t line_start = 0;
  for (std::size_t at = 0; at < text.size();) {
    const auto c = static_cast<unsigned char>(text[at]);
    const std::size_t length = CharacterLength(text.substr(at));
    const bool control = (c < 0x20 && c != '\n' && c != '\r' && c != '\t') || c == 0x7F;
    if (length == 0 || control) {
      const std::string what = length == 0 ? "not valid UTF-8" : "a control character";
      return Problem{"",
                     absl::StrCat("byte 0x", absl::Hex(c, absl::kZeroPad2), " is ", what,
                                  ": not a text file?"),
                     false, line, static_cast<int>(at - line_start) + 1};
    }
    at += length;
    if (c == '\n') {
      ++line;
      line_start = at;
    }
  }
  return std::nullopt;
}

}  // namespace adhesim
