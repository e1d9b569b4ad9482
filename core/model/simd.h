#pragma once

// Compiles a function once for each instruction set and chooses at start. Not under sanitizers:
// their run-time is not ready when the choice is made.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__x86_64__)
#define ADHESIM_DISPATCH
#else
#define ADHESIM_DISPATCH __attribute__((target_clones("avx2", "default")))
#define ADHESIM_DISPATCHES 1
#endif

namespace adhesim {

// The instruction set that ADHESIM_DISPATCH chooses on this machine.
inline const char* SimdTarget() {
#ifdef ADHESIM_DISPATCHES
  return __builtin_cpu_supports("avx2") ? "avx2" : "baseline";
#else
  return "baseline";
#endif
}

}  // namespace adhesim
