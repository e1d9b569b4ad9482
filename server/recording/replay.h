#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/recording/recording_format.h"

namespace adhesim {

struct ReplayOptions {
  bool verify = false;  // compare the hash of every step
  int threads = 1;
  // Asked for when stepping begins, since nothing looks before; ends the replay when true.
  std::function<const std::atomic<bool>&()> stop = nullptr;
};

// The first step whose hash is not the recorded one.
struct ReplayDifference {
  std::uint64_t index = 0;  // steps since the recording began, this one included
  std::uint64_t step = 0;   // since the start or the last reset
  double time_s = 0;
  std::uint64_t actual = 0;
  std::optional<std::uint64_t> expected;  // absent: the recording has no hash of this step
};

struct ReplayResult {
  RecordingAbout about;
  double dt_s = 0;
  std::uint64_t steps = 0;     // replayed
  std::uint64_t verified = 0;  // of them, with the recorded hash
  std::uint64_t frames = 0;    // in the recording
  std::uint64_t final_hash = 0;
  std::optional<ReplayDifference> difference;
  std::optional<std::uint64_t> truncated_at;  // bytes of the file that are whole
  bool writer_was_behind = false;             // the recorder itself ended early, and said so
  std::vector<McapDamage> damage;
  bool interrupted = false;
};

// Rebuilds the scene and its engine and applies the recorded inputs by step; consults no clock.
// With `verify` it ends at the first step that differs. Errors: the file is no recording (NotFound,
// InvalidArgument), its scene cannot be built, or its metadata contradict the scene.
absl::StatusOr<ReplayResult> Replay(const std::string& path, const ReplayOptions& options);

}  // namespace adhesim
