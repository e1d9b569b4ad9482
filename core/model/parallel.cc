#include "core/model/parallel.h"

namespace adhesim {

Parallel::Parallel(int threads, Simd simd) : simd_(simd) {
  for (int share = 1; share < threads; ++share) {
    workers_.emplace_back([this, share] { Work(share); });
  }
}

Parallel::~Parallel() {
  stop_.store(true);
  round_.fetch_add(1);
  round_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void Parallel::RunShare(int share) const {
  const std::int64_t parts = threads();
  const int begin = static_cast<int>(count_ * std::int64_t{share} / parts);
  const int end = static_cast<int>(count_ * std::int64_t{share + 1} / parts);
  if (begin < end) job_(context_, begin, end);
}

void Parallel::Run(int count, Job job, const void* context) {
  job_ = job;
  context_ = context;
  count_ = count;
  pending_.store(static_cast<int>(workers_.size()), std::memory_order_relaxed);
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
  RunShare(0);
  for (int left = pending_.load(std::memory_order_acquire); left != 0;
       left = pending_.load(std::memory_order_acquire)) {
    pending_.wait(left, std::memory_order_acquire);
  }
}

void Parallel::Work(int share) {
  std::uint32_t seen = 0;
  for (;;) {
    round_.wait(seen, std::memory_order_acquire);
    seen = round_.load(std::memory_order_acquire);
    if (stop_.load(std::memory_order_relaxed)) return;
    RunShare(share);
    if (pending_.fetch_sub(1, std::memory_order_acq_rel) == 1) pending_.notify_one();
  }
}

}  // namespace adhesim
