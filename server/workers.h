#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace adhesim {

// A few threads for work that takes long (building a scene, ending a session), away from the
// transports' own.
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
  // Guards the rest. A standard mutex: thread sanitizers do not see through Abseil's as packaged.
  std::mutex mutex_;
  std::condition_variable ready_;
  std::deque<std::function<void()>> waiting_;
  bool ending_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace adhesim
