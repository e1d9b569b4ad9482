#pragma once

#include <absl/strings/string_view.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace adhesim {

// The number of type T that begins at `position` (position + sizeof(T) <= bytes.size()).
template <typename T>
T LoadNumber(absl::string_view bytes, std::size_t position, bool big_endian) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), bytes.data() + position, sizeof(T));
  if (big_endian != (std::endian::native == std::endian::big)) {
    std::reverse(raw.begin(), raw.end());
  }
  return std::bit_cast<T>(raw);
}

}  // namespace adhesim
