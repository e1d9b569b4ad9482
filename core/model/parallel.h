#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#include "core/model/simd.h"

namespace adhesim {

// What loops run on: a fixed team of threads, and an instruction set. Iterations write disjoint
// results, so that neither ever changes a bit. For() allocates nothing and takes no lock; workers
// sleep on a futex between loops.
class Parallel {
 public:
  // `threads` counts the calling thread; 1 starts no worker.
  explicit Parallel(int threads, Simd simd = BestSimd());
  ~Parallel();
  Parallel(const Parallel&) = delete;
  Parallel& operator=(const Parallel&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }
  Simd simd() const { return simd_; }

  // Calls body(begin, end) on consecutive ranges that cover [0, count). Ranges shorter than `grain`
  // are not split: waking a thread costs some 10 us, so a grain should hold at least that much
  // work.
  template <typename Body>
  void For(int count, int grain, const Body& body) {
    if (workers_.empty() || count <= grain) {
      if (count > 0) body(0, count);
      return;
    }
    Run(
        count,
        [](const void* context, int begin, int end) {
          (*static_cast<const Body*>(context))(begin, end);
        },
        &body);
  }

  // The same, with the body compiled for each instruction set.
  template <typename Body>
  void VectorFor(int count, int grain, const Body& body) {
    For(count, grain, [&](int begin, int end) { RunSimd(simd_, [&](auto) { body(begin, end); }); });
  }

 private:
  using Job = void (*)(const void* context, int begin, int end);
  void Run(int count, Job job, const void* context);
  void RunShare(int share) const;
  void Work(int share);

  Simd simd_;
  std::vector<std::thread> workers_;
  Job job_ = nullptr;
  const void* context_ = nullptr;
  int count_ = 0;
  std::atomic<std::uint32_t> round_{0};
  std::atomic<int> pending_{0};
  std::atomic<bool> stop_{false};
};

}  // namespace adhesim
