#pragma once

#include <cstdlib>
#include <string_view>

namespace adhesim {

// The size at which a test shows its claim: `gate` in every run, `full` under `./dev test --all`.
inline int TestSize(int gate, int full) {
  const char* size = std::getenv("ADHESIM_TEST_SIZE");
  return size != nullptr && std::string_view(size) == "full" ? full : gate;
}

}  // namespace adhesim
