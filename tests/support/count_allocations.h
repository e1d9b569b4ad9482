#pragma once

// Replaces the program's allocation functions by counting ones: include in one source of a test
// program.

#include <atomic>
#include <cstdlib>
#include <new>

namespace adhesim::test {

inline std::atomic<long> allocations{0};
inline std::atomic<long> allocated_bytes{0};

inline void* CountedAlloc(std::size_t size,
                          std::size_t alignment = alignof(std::max_align_t)) noexcept {
  ++allocations;
  allocated_bytes += static_cast<long>(size);
  return std::aligned_alloc(alignment, (size / alignment + 1) * alignment);
}

inline void* CountedOrThrow(std::size_t size, std::size_t alignment = alignof(std::max_align_t)) {
  if (void* p = CountedAlloc(size, alignment)) return p;
  throw std::bad_alloc();
}

// A call of its own: free() inlined beside a library's operator new looks like a mismatch to GCC.
[[gnu::noinline]] inline void Free(void* p) noexcept { std::free(p); }

}  // namespace adhesim::test

// Every form, so that what one makes the other may free (the sanitizers compare).
void* operator new(std::size_t size) { return adhesim::test::CountedOrThrow(size); }
void* operator new[](std::size_t size) { return adhesim::test::CountedOrThrow(size); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return adhesim::test::CountedAlloc(size);
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return adhesim::test::CountedAlloc(size);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return adhesim::test::CountedOrThrow(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return adhesim::test::CountedOrThrow(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* p) noexcept { adhesim::test::Free(p); }
void operator delete[](void* p) noexcept { adhesim::test::Free(p); }
void operator delete(void* p, std::size_t) noexcept { adhesim::test::Free(p); }
void operator delete[](void* p, std::size_t) noexcept { adhesim::test::Free(p); }
void operator delete(void* p, const std::nothrow_t&) noexcept { adhesim::test::Free(p); }
void operator delete[](void* p, const std::nothrow_t&) noexcept { adhesim::test::Free(p); }
void operator delete(void* p, std::align_val_t) noexcept { adhesim::test::Free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { adhesim::test::Free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { adhesim::test::Free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { adhesim::test::Free(p); }
