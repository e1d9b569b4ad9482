#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <string>
#include <vector>

namespace adhesim {

// Recordings that pictures are taken of.

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
