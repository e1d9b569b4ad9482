#include "server/recording/recorded_scene.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <utility>

#include "core/scene/body_file.h"
#include "core/scene/build_model.h"
#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "server/recording/recording_directory.h"
#include "server/recording/temporary_directory.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

// The name in the scene decides how a file is read (".inr.gz"), and nothing else: where it is
// written does not follow from it.
std::string UnpackedName(std::size_t index, const std::string& name) {
  const std::size_t part = name.find_last_of("/:\\");
  const std::string last = part == name.npos ? name : name.substr(part + 1);
  // The end is what matters.
  return absl::StrCat(
      index, "_", FileNamePart(last.substr(last.size() - std::min<std::size_t>(last.size(), 60))));
}

// Writes the file that a body names, and makes the body name that.
absl::Status Unpack(const std::vector<SceneAsset>& assets, const std::string& directory,
                    std::string* file) {
  const auto asset = std::find_if(assets.begin(), assets.end(),
                                  [&](const SceneAsset& a) { return a.name == *file; });
  if (asset == assets.end()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the scene names the file \"", Escaped(*file), "\", which is not attached"));
  }
  *file = UnpackedName(asset - assets.begin(), *file);
  std::ofstream out(fs::path(directory) / *file, std::ios::binary);
  out.write(asset->bytes.data(), static_cast<std::streamsize>(asset->bytes.size()));
  out.close();
  if (out) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("a mesh cannot be unpacked into ", directory));
}

absl::Status Refuse(const Problems& problems) {
  std::string text = "the recorded scene is wrong";
  for (const Problem& problem : problems) {
    if (!problem.warning) absl::StrAppend(&text, "; ", problem.path, ": ", problem.message);
  }
  // They quote the scene.
  std::replace_if(
      text.begin(), text.end(), [](char c) { return !(c >= 0x20 && c < 0x7F); }, '?');
  return absl::InvalidArgumentError(text);
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Model>> BuildRecordedModel(
    const RecordingBeginning& beginning) {
  v1::Scene scene = beginning.scene;
  const Problems problems = ValidateScene(scene);
  if (!AllWarnings(problems)) return Refuse(problems);
  const absl::StatusOr<std::unique_ptr<TemporaryDirectory>> directory = TemporaryDirectory::Make();
  if (!directory.ok()) return directory.status();
  for (v1::Body& body : *scene.mutable_bodies()) {
    std::string* file = MutableFileOf(&body);
    if (file == nullptr) continue;
    const absl::Status status = Unpack(beginning.assets, (*directory)->path(), file);
    if (!status.ok()) return status;
  }
  BuiltModel built = BuildModel(WithDefaults(scene), (*directory)->path());
  if (built.model == nullptr || !AllWarnings(built.problems)) return Refuse(built.problems);
  return built.model;
}

}  // namespace adhesim
