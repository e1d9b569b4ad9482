#pragma once

#include <absl/base/thread_annotations.h>
#include <absl/synchronization/mutex.h>

#include <cstddef>
#include <deque>
#include <functional>
#include <thread>
#include <vector>

namespace adhesim {

// A few threads for work that takes long (building a scene, ending a session), away from gRPC's
// two.
class Workers {
 public:
  Workers(int threads, std::size_t capacity);
  // Does what was accepted, then ends.
  ~Workers();

  // False when `capacity` pieces of work wait already.
  bool Post(std::function<void()> work);

 private:
  void Loop();

  const std::size_t capacity_;
  absl::Mutex mutex_;
  std::deque<std::function<void()>> waiting_ ABSL_GUARDED_BY(mutex_);
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

}  // namespace adhesim
