#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

namespace adhesim {

// A bounded first-in first-out queue from one writer thread to one reader thread, wait-free. Values
// are filled and read in their slots, so that arrays in them keep their memory: nothing is
// allocated after construction.
template <typename T>
class SlotRing {
 public:
  // `make()` gives each slot a value of its own.
  template <typename Make>
  SlotRing(std::size_t capacity, const Make& make) {
    slots_.reserve(capacity);
    for (std::size_t i = 0; i < capacity; ++i) slots_.push_back(make());
  }

  std::size_t capacity() const { return slots_.size(); }
  // Either thread; exact for the writer but for what the reader takes meanwhile.
  std::size_t size() const {
    return tail_.load(std::memory_order_acquire) - head_.load(std::memory_order_acquire);
  }

  // Writer: the slot to fill, or null when there is none.
  T* Back() {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_.load(std::memory_order_acquire) == slots_.size()) return nullptr;
    return &slots_[tail % slots_.size()];
  }
  // Writer: hands over Back().
  void Push() { tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

  // Reader: the oldest, or null when there is none.
  const T* Front() const {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return nullptr;
    return &slots_[head % slots_.size()];
  }
  // Reader: gives Front() back.
  void Pop() { head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

 private:
  std::vector<T> slots_;
  alignas(64) std::atomic<std::size_t> tail_{0};
  alignas(64) std::atomic<std::size_t> head_{0};
};

}  // namespace adhesim
