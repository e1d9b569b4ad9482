#pragma once

#include <malloc.h>

#include <cstddef>

namespace adhesim {

// How much of the heap the program uses, and how that grows: what a part's arrays take, whoever
// allocates them, while no other thread does. Other allocators than the C library's show nothing.
class HeapMeter {
 public:
  // Bytes that came into use since the last call.
  std::size_t Take() {
    const std::size_t now = InUse(), before = last_;
    last_ = now;
    return now > before ? now - before : 0;
  }

 private:
  static std::size_t InUse() {
    const struct mallinfo2 heap = mallinfo2();
    return heap.uordblks + heap.hblkhd;
  }
  std::size_t last_ = InUse();
};

}  // namespace adhesim
