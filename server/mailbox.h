#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace adhesim {

// Hands the newest value of one writer thread to one reader thread; both are wait-free and neither
// allocates.
//
// Three slots: the writer fills one, the reader reads one, and the third changes hands in one
// atomic exchange. A value that is overtaken before the reader looks is never seen. A single
// lock-free word, rather than a sequence lock, so that a reader never reads bytes that are being
// written (and thread sanitizers can check it).
//
// Writer (and reader) may change threads, when something else orders the hand-over.
template <typename T>
class NewestWins {
 public:
  NewestWins() = default;
  // Each slot starts as a value of its own from `make()`: copies would lose the capacity of arrays.
  template <typename Make>
  explicit NewestWins(const Make& make) : slots_{make(), make(), make()} {}
  NewestWins(const NewestWins&) = delete;
  NewestWins& operator=(const NewestWins&) = delete;

  // Writer: the slot to fill. It holds some older value.
  T& back() { return slots_[back_]; }

  // Writer: the value published last (as at the start, before the first). Reading it beside the
  // reader is safe.
  const T& published() const { return slots_[published_]; }

  // Writer: hands over back(). True when the value before it was never seen.
  bool Publish() {
    published_ = back_;
    const std::uint8_t old =
        middle_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel);
    back_ = old & kIndex;
    return (old & kFresh) != 0;
  }

  // Reader: true when there is a value newer than front(), which becomes front().
  bool Update() {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    const std::uint8_t old = middle_.exchange(front_, std::memory_order_acq_rel);
    front_ = old & kIndex;
    return true;
  }

  // Reader: the newest value at the last Update().
  const T& front() const { return slots_[front_]; }

 private:
  static constexpr std::uint8_t kFresh = 4;
  static constexpr std::uint8_t kIndex = 3;

  std::array<T, 3> slots_{};
  // A cache line each, so that writer and reader do not slow each other down.
  alignas(64) std::uint8_t back_ = 0;
  std::uint8_t published_ = 1;
  alignas(64) std::atomic<std::uint8_t> middle_{1};
  alignas(64) std::uint8_t front_ = 2;
};

// A bounded first-in first-out queue from one writer thread to one reader thread, wait-free.
template <typename T, std::size_t kCapacity>
class BoundedQueue {
 public:
  // Writer: false when full.
  bool Push(T value) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_.load(std::memory_order_acquire) == kCapacity) return false;
    slots_[tail % kCapacity] = std::move(value);
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  // Reader: false when empty.
  bool Pop(T* value) {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    *value = std::move(slots_[head % kCapacity]);
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

 private:
  std::array<T, kCapacity> slots_{};
  alignas(64) std::atomic<std::size_t> tail_{0};
  alignas(64) std::atomic<std::size_t> head_{0};
};

}  // namespace adhesim
