#pragma once

#include <cstdint>

namespace adhesim {

// What the operating system grants a thread that has deadlines. Measured under load: kFifo wakes
// within 0.1 ms, kShortSlice within 0.1 to 3 ms, kPlain within 5 to 300 ms (99th percentiles).
enum class RealtimeClass {
  kFifo,        // SCHED_FIFO
  kShortSlice,  // SCHED_OTHER with a 0.1 ms slice (kernel 6.12 and later)
  kPlain,
};

// Gives the calling thread the best class that is permitted. `priority` counts for kFifo, 1..99.
RealtimeClass BecomeRealtime(int priority);
// Back to SCHED_OTHER: for work without a deadline, which must not keep others waiting.
void BecomePlain();
// The class that BecomeRealtime() would give, found on a thread of its own.
RealtimeClass ProbeRealtimeClass();
// Keeps the pages that the process touches in memory. False when not permitted.
bool LockMemory();

// CLOCK_MONOTONIC, ns.
std::int64_t MonotonicNs();
// Sleeps until MonotonicNs() reaches the time; returns at once when it is past.
void SleepUntil(std::int64_t time_ns);

// Wakes one thread from others: a counter of the kernel (eventfd), so that waking neither locks nor
// allocates.
class Waker {
 public:
  Waker();
  ~Waker();
  Waker(const Waker&) = delete;
  Waker& operator=(const Waker&) = delete;

  void Wake();
  // Returns when woken since the last Wait(), or after the time.
  void Wait(int timeout_ms);

 private:
  int fd_;
};

}  // namespace adhesim
