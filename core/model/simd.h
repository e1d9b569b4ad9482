#pragma once

#include <type_traits>
#include <vector>

namespace adhesim {

// The instruction sets that vector loops are compiled for. Every one gives the same bits: one
// element a lane, no fused multiply-adds, sums in a fixed order (docs/decisions/0009-speed.md).
enum class Simd { kBaseline, kAvx2, kAvx512 };

inline const char* SimdName(Simd simd) {
  return simd == Simd::kAvx512 ? "avx512" : simd == Simd::kAvx2 ? "avx2" : "baseline";
}

// Those that this build has and this machine can run, from the plainest to the best.
inline std::vector<Simd> AvailableSimd() {
  std::vector<Simd> available = {Simd::kBaseline};
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx2")) available.push_back(Simd::kAvx2);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw")) {
    available.push_back(Simd::kAvx512);
  }
#endif
  return available;
}

inline Simd BestSimd() { return AvailableSimd().back(); }

// Name of the one that engines use where nobody chose another.
inline const char* SimdTarget() { return SimdName(BestSimd()); }

// `flatten`: everything that the loop calls is compiled into it, for its instruction set.
#ifdef __x86_64__
#define ADHESIM_AVX2 __attribute__((target("avx2"), flatten))
#define ADHESIM_AVX512 __attribute__((target("avx2,avx512f,avx512vl,avx512dq,avx512bw"), flatten))
#else
#define ADHESIM_AVX2
#define ADHESIM_AVX512
#endif

// Calls loop(std::integral_constant<Simd, ...>) compiled for `simd`, one of AvailableSimd(). Chosen
// by a branch, not by the loader: sanitizers are not ready when the loader chooses.
template <typename Loop>
ADHESIM_AVX512 void RunAvx512(const Loop& loop) {
  loop(std::integral_constant<Simd, Simd::kAvx512>());
}
template <typename Loop>
ADHESIM_AVX2 void RunAvx2(const Loop& loop) {
  loop(std::integral_constant<Simd, Simd::kAvx2>());
}
template <typename Loop>
void RunSimd(Simd simd, const Loop& loop) {
  switch (simd) {
    case Simd::kAvx512:
      return RunAvx512(loop);
    case Simd::kAvx2:
      return RunAvx2(loop);
    case Simd::kBaseline:
      return loop(std::integral_constant<Simd, Simd::kBaseline>());
  }
}

}  // namespace adhesim
