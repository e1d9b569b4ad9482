#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <google/protobuf/descriptor.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "adhesim/v1/scene.pb.h"
#include "server/recording/mcap_reader.h"
#include "server/recording/mcap_writer.h"

// What a recording is beyond MCAP (docs/recordings.md): its channels, its metadata record
// "adhesim", and its attachments, which make it independent of every other file.
namespace adhesim {

inline constexpr char kTopologyTopic[] = "/topology";  // v1.WatchResponse, once
inline constexpr char kFramesTopic[] = "/frames";      // v1.WatchResponse
inline constexpr char kInputsTopic[] = "/inputs";      // v1.StepInputs, when they change
inline constexpr char kHashesTopic[] = "/hashes";      // v1.StateHashes, for every step
inline constexpr char kForcesTopic[] = "/forces";      // v1.ToolForces, every step
inline constexpr char kEventsTopic[] = "/events";      // v1.Event

// What the recording says about itself.
struct RecordingAbout {
  std::string version, build;  // of the program that wrote it
  std::string session;         // the session's id
  std::string scene_name;
  double rate_hz = 0;
  std::uint64_t seed = 0;
};

// A file that the scene names; `name` is how it does ("asset:liver.inr.gz").
struct SceneAsset {
  std::string name, bytes;
};

// Channel ids of a recording.
struct RecordingChannels {
  std::uint16_t topology, frames, inputs, hashes, forces, events;
};

// Simulated time since a recording began, after so many steps, ns.
inline std::uint64_t LogTime(std::uint64_t index, double dt_s) {
  return static_cast<std::uint64_t>(std::llround(static_cast<double>(index) * dt_s * 1e9));
}

// The files that the scene's bodies name, each once. Errors: one that cannot be read.
absl::StatusOr<std::vector<SceneAsset>> ReadSceneAssets(const v1::Scene& scene,
                                                        const std::string& directory);

// Everything before the first message. `scene` is resolved: defaults written out.
RecordingChannels WriteBeginning(const RecordingAbout& about, const v1::Scene& scene,
                                 const std::vector<SceneAsset>& assets, McapWriter* writer);

// The same, read back. The scene is not validated. Errors: InvalidArgument for an MCAP file that is
// no recording of ours, one of a later format, or one that ends too early.
struct RecordingBeginning {
  RecordingAbout about;
  v1::Scene scene;
  std::vector<SceneAsset> assets;
};
absl::StatusOr<RecordingBeginning> ReadBeginning(const McapReader& reader, const std::string& path);

// The message's file and all that it imports, serialised as a FileDescriptorSet, imports first.
std::string DescriptorSet(const google::protobuf::Descriptor* message);

}  // namespace adhesim
