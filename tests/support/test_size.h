#pragma once

#include <cstdlib>
#include <string_view>

namespace adhesim {

// The size at which a test shows its claim: `gate` in every run, `full` under `./dev test --all`.
inline int TestSize(int gate, int full) {
  const char* size = std::getenv("ADHESIM_TEST_SIZE");
  return size != nullptr && std::string_view(size) == "full" ? full : gate;
}

// Sanitizers make a step twenty times slower and look for mistakes that a short run makes as well.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace adhesim
