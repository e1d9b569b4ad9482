#include "server/realtime.h"

#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <thread>

namespace adhesim {
namespace {

constexpr std::int64_t kNsPerS = 1'000'000'000;

// The kernel's struct sched_attr, first version; glibc 2.36 has neither the structure nor the call.
struct SchedulingAttributes {
  std::uint32_t size;
  std::uint32_t policy;
  std::uint64_t flags;
  std::int32_t nice;
  std::uint32_t priority;
  std::uint64_t runtime_ns;
  std::uint64_t deadline_ns;
  std::uint64_t period_ns;
};

// A slice of `ns` under the fair scheduler; older kernels accept and ignore it, which nobody can
// tell from here.
bool RequestSlice(std::uint64_t ns) {
  SchedulingAttributes attributes{};
  attributes.size = sizeof(attributes);
  attributes.policy = SCHED_OTHER;
  attributes.runtime_ns = ns;
  return syscall(SYS_sched_setattr, 0, &attributes, 0) == 0;
}

}  // namespace

RealtimeClass BecomeRealtime(int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0) {
    return RealtimeClass::kFifo;
  }
  return RequestSlice(100'000) ? RealtimeClass::kShortSlice : RealtimeClass::kPlain;
}

void BecomePlain() {
  sched_param parameters{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &parameters);
}

RealtimeClass ProbeRealtimeClass() {
  RealtimeClass result = RealtimeClass::kPlain;
  std::thread probe([&result] { result = BecomeRealtime(1); });
  probe.join();
  return result;
}

bool LockMemory() {
  // On fault: without it every thread's whole stack (8 MiB) would be made resident at once.
  return mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0;
}

std::int64_t MonotonicNs() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kNsPerS + now.tv_nsec;
}

void SleepUntil(std::int64_t time_ns) {
  timespec until;
  until.tv_sec = time_ns / kNsPerS;
  until.tv_nsec = time_ns % kNsPerS;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

Waker::Waker() : fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (fd_ < 0) throw std::runtime_error("no file descriptor left for a session");
}

Waker::~Waker() { close(fd_); }

void Waker::Wake() {
  const std::uint64_t one = 1;
  // Fails only when the counter is full: then the other side is being woken already.
  [[maybe_unused]] const ssize_t written = write(fd_, &one, sizeof(one));
}

void Waker::Wait(int timeout_ms) {
  pollfd waiting{fd_, POLLIN, 0};
  if (poll(&waiting, 1, timeout_ms) <= 0) return;
  std::uint64_t count;
  [[maybe_unused]] const ssize_t got = read(fd_, &count, sizeof(count));
}

}  // namespace adhesim
