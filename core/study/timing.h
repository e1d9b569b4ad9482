#pragma once

#include <algorithm>
#include <cmath>
#include <ctime>
#include <vector>

namespace adhesim {

// CPU time of the calling thread, ms.
inline double ThreadCpuMs() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

// A value that occurred, by nearest rank (0.5: the median); 0 of nothing.
inline double Percentile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  const auto rank =
      static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values.size())));
  const auto at = values.begin() +
                  static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, values.size())) - 1;
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace adhesim
