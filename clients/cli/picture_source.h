#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/engine/engine.h"

namespace adhesim {

// Recordings that pictures are taken of.

// Writes frames of an engine into a recording, those that pictures are taken of.
class InstantWriter {
 public:
  // Begins the file, with the scene and no frame. The engine may step on, but must live.
  static absl::StatusOr<std::unique_ptr<InstantWriter>> Open(const std::string& file,
                                                             const Engine& engine);
  ~InstantWriter();

  // The engine's state as it is now, later than the one before.
  void Write();
  absl::Status Finish();

 private:
  struct Parts;
  explicit InstantWriter(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

// Whether a file begins as MCAP files do.
bool IsMcap(const std::string& path);

// Runs a scene up to the last of the instants and writes a recording that holds the start and the
// frames at these instants, and nothing else. Every mistake in the scene goes to stderr. Errors:
// InvalidArgument; Cancelled when `stop` says so; Internal when the state becomes non-finite first.
absl::Status RecordInstants(const std::string& scene, const std::vector<std::string>& settings,
                            std::vector<double> times_s, const std::string& file,
                            const std::function<bool()>& stop);

// Time of a recording's last frame since it began, s. Errors: InvalidArgument for a file that is no
// recording or has no frames.
absl::StatusOr<double> LastFrameTime(const std::string& file);

}  // namespace adhesim
