#include "server/recording/recording_format.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <google/protobuf/descriptor.pb.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <utility>

#include "adhesim/v1/recording.pb.h"
#include "adhesim/v1/view_service.pb.h"
#include "core/scene/body_file.h"
#include "core/scene/mesh/read_file.h"
#include "core/scene/mesh/read_surface.h"
#include "core/scene/scene_text.h"

namespace adhesim {
namespace {

namespace pb = google::protobuf;

constexpr char kMetadataName[] = "adhesim";
// Raised when a reader of today could not replay a recording of tomorrow.
constexpr char kFormat[] = "1";
// The scene as a message. The metadata has it as text, too, for people; but scenes sent by clients
// may be larger than the text that the scene reader takes.
constexpr char kSceneAttachment[] = "scene.binpb";
// Of the files, and of what is left for the scene itself and the attachments' own bytes.
constexpr std::size_t kMaxAssetBytes = kMaxAttachmentBytes - (std::size_t{32} << 20);
// A longer text is left out: nobody would read it, and the reader would not take it.
constexpr std::size_t kMaxSceneText = kMaxDescriptionBytes / 2;

// Shortest text that reads back to the same number.
std::string NumberText(double value) {
  char buffer[32];
  return {buffer, std::to_chars(buffer, buffer + sizeof(buffer), value).ptr};
}

void AddFile(const pb::FileDescriptor* file, std::set<std::string>* seen,
             pb::FileDescriptorSet* set) {
  if (!seen->insert(file->name()).second) return;
  for (int i = 0; i < file->dependency_count(); ++i) AddFile(file->dependency(i), seen, set);
  file->CopyTo(set->add_file());
}

template <typename Message>
std::uint16_t AddSchema(McapWriter* writer) {
  return writer->AddSchema(Message::descriptor()->full_name(), "protobuf",
                           DescriptorSet(Message::descriptor()));
}

}  // namespace

std::string DescriptorSet(const pb::Descriptor* message) {
  std::set<std::string> seen;
  pb::FileDescriptorSet set;
  AddFile(message->file(), &seen, &set);
  return set.SerializeAsString();
}

absl::StatusOr<std::vector<SceneAsset>> ReadSceneAssets(const v1::Scene& scene,
                                                        const std::string& directory) {
  std::vector<SceneAsset> assets;
  std::size_t left = kMaxAssetBytes;
  for (const v1::Body& body : scene.bodies()) {
    const std::string name = FileOf(body) == nullptr ? "" : *FileOf(body);
    const auto same = [&](const SceneAsset& asset) { return asset.name == name; };
    if (name.empty() || std::any_of(assets.begin(), assets.end(), same)) continue;
    const absl::StatusOr<std::string> path = ResolveFile(name, directory);
    if (!path.ok()) return path.status();
    absl::StatusOr<std::string> bytes = ReadFile(*path, left);
    if (!bytes.ok()) return bytes.status();
    left -= bytes->size();
    assets.push_back({name, *std::move(bytes)});
  }
  return assets;
}

RecordingChannels WriteBeginning(const RecordingAbout& about, const v1::Scene& scene,
                                 const std::vector<SceneAsset>& assets, McapWriter* writer) {
  std::string text = SceneToYaml(scene);
  if (text.size() > kMaxSceneText) text.clear();
  writer->AddMetadata(kMetadataName, {{"format", kFormat},
                                      {"version", about.version},
                                      {"build", about.build},
                                      {"session", about.session},
                                      {"scene_name", about.scene_name},
                                      {"rate_hz", NumberText(about.rate_hz)},
                                      {"seed", absl::StrCat(about.seed)},
                                      {"scene", text}});
  writer->AddAttachment(kSceneAttachment, "application/x-protobuf", scene.SerializeAsString());
  for (const SceneAsset& asset : assets) {
    writer->AddAttachment(asset.name, "application/octet-stream", asset.bytes);
  }
  const std::uint16_t view = AddSchema<v1::WatchResponse>(writer);
  const std::uint16_t inputs = AddSchema<v1::StepInputs>(writer);
  const std::uint16_t hashes = AddSchema<v1::StateHashes>(writer);
  const std::uint16_t forces = AddSchema<v1::ToolForces>(writer);
  const std::uint16_t events = AddSchema<v1::Event>(writer);
  RecordingChannels channels{};
  channels.topology = writer->AddChannel(view, kTopologyTopic, "protobuf");
  channels.frames = writer->AddChannel(view, kFramesTopic, "protobuf");
  channels.inputs = writer->AddChannel(inputs, kInputsTopic, "protobuf");
  channels.hashes = writer->AddChannel(hashes, kHashesTopic, "protobuf");
  channels.forces = writer->AddChannel(forces, kForcesTopic, "protobuf");
  channels.events = writer->AddChannel(events, kEventsTopic, "protobuf");
  return channels;
}

absl::StatusOr<RecordingBeginning> ReadBeginning(const McapReader& reader,
                                                 const std::string& path) {
  const auto refuse = [&](const std::string& what) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", what));
  };
  const auto metadata = reader.metadata().find(kMetadataName);
  const auto scene_bytes =
      std::find_if(reader.attachments().begin(), reader.attachments().end(),
                   [](const McapAttachment& a) { return a.name == kSceneAttachment; });
  const bool has_scene = scene_bytes != reader.attachments().end();
  if (reader.truncated_at() && (metadata == reader.metadata().end() || !has_scene)) {
    return refuse(absl::StrCat("ends at byte ", *reader.truncated_at(),
                               ", before the beginning of a recording is complete"));
  }
  if (metadata == reader.metadata().end()) {
    return refuse(
        "an MCAP file, but not a recording of adhesim: no metadata record \"adhesim\" stands "
        "before its first message");
  }
  const auto value = [&](const char* key) -> std::string {
    const auto found = metadata->second.find(key);
    return found == metadata->second.end() ? "" : found->second;
  };
  if (value("format") != kFormat) {
    return refuse(absl::StrCat("a recording of format \"", Escaped(value("format")),
                               "\" (metadata \"adhesim\"), permitted is \"", kFormat, "\""));
  }
  RecordingBeginning beginning;
  RecordingAbout& about = beginning.about;
  about.version = value("version");
  about.build = value("build");
  about.session = value("session");
  about.scene_name = value("scene_name");
  if (!absl::SimpleAtod(value("rate_hz"), &about.rate_hz) ||
      !absl::SimpleAtoi(value("seed"), &about.seed)) {
    return refuse(absl::StrCat("rate_hz is \"", Escaped(value("rate_hz")), "\" and seed \"",
                               Escaped(value("seed")),
                               "\" (metadata \"adhesim\"), permitted are numbers"));
  }
  if (!has_scene) return refuse(absl::StrCat("no attachment \"", kSceneAttachment, "\""));
  if (!beginning.scene.ParseFromString(scene_bytes->data)) {
    return refuse(absl::StrCat("the attachment \"", kSceneAttachment, "\" holds no scene"));
  }
  for (const McapAttachment& attachment : reader.attachments()) {
    if (attachment.name == kSceneAttachment) continue;
    beginning.assets.push_back({attachment.name, attachment.data});
  }
  return beginning;
}

}  // namespace adhesim
