#include "server/recording/recording_directory.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <utility>
#include <vector>

#include "server/errors.h"
#include "server/recording/file_sink.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

constexpr char kExtension[] = ".mcap";
constexpr std::size_t kMostNameBytes = 64;
constexpr std::size_t kMostFileNameBytes = 255;

bool IsPlain(char c) { return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-'; }

}  // namespace

std::string FileNamePart(const std::string& text) {
  std::string part = text.substr(0, kMostNameBytes);
  std::replace_if(
      part.begin(), part.end(), [](char c) { return !IsPlain(c); }, '_');
  const bool hidden = part.empty() || part[0] == '.';
  return hidden ? absl::StrCat("_", part) : part;
}

absl::StatusOr<std::shared_ptr<RecordingDirectory>> RecordingDirectory::Open(
    const std::string& path, const Recorder::Options& options, const std::string& version,
    const std::string& build) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!fs::is_directory(path)) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': not a directory, and none can be made there: ",
                     error ? error.message() : "something else has its name"));
  }
  return std::shared_ptr<RecordingDirectory>(new RecordingDirectory(path, options, version, build));
}

RecordingDirectory::RecordingDirectory(std::string path, Recorder::Options options,
                                       std::string version, std::string build)
    : path_(std::move(path)),
      options_(std::move(options)),
      version_(std::move(version)),
      build_(std::move(build)) {}

absl::StatusOr<std::shared_ptr<StepObserver>> RecordingDirectory::Record(
    const std::string& session_id, const ReadScene& scene, const Engine& engine) {
  const Model& model = engine.model();
  absl::StatusOr<std::vector<SceneAsset>> assets = ReadSceneAssets(model.scene, scene.directory);
  if (!assets.ok()) return assets.status();
  const std::string name =
      absl::StrCat(FileNamePart(model.name), "-", FileNamePart(session_id), kExtension);
  absl::StatusOr<ByteSink> sink = OpenFileSink((fs::path(path_) / name).string(), true);
  if (!sink.ok()) return sink.status();
  const RecordingAbout about{version_, build_, session_id, model.name, 1 / model.dt_s, model.seed};
  Recorder::Options options = options_;
  options.warn = [session_id](const std::string& what) {
    std::cerr << absl::StrCat("session ", session_id, ": ", what, "\n") << std::flush;
  };
  auto recorder = std::make_shared<Recorder>(*std::move(sink), options, about, *assets, engine);
  const std::lock_guard lock(mutex_);
  std::erase_if(own_, [](const auto& entry) { return entry.second.recorder.expired(); });
  own_[name] = {session_id, recorder};
  return recorder;
}

v1::ListRecordingsResponse RecordingDirectory::List() const {
  std::vector<fs::directory_entry> files;
  std::error_code error;
  for (fs::directory_iterator it(path_, error), end; !error && it != end; it.increment(error)) {
    if (it->is_regular_file(error) && it->path().extension() == kExtension) files.push_back(*it);
  }
  std::sort(files.begin(), files.end());
  v1::ListRecordingsResponse response;
  const std::lock_guard lock(mutex_);
  for (const fs::directory_entry& file : files) {
    std::error_code gone;
    const std::uintmax_t bytes = file.file_size(gone);
    if (gone) continue;
    v1::Recording* recording = response.add_recordings();
    recording->set_name(file.path().filename().string());
    recording->set_bytes(bytes);
    const auto own = own_.find(recording->name());
    const std::shared_ptr<Recorder> recorder =
        own == own_.end() ? nullptr : own->second.recorder.lock();
    if (recorder == nullptr || !recorder->open()) continue;
    recording->set_open(true);
    recording->set_session(own->second.session);
  }
  return response;
}

absl::StatusOr<std::string> RecordingDirectory::Find(const std::string& name) const {
  const bool plain = name.size() <= kMostFileNameBytes && !name.starts_with(".") &&
                     name.ends_with(kExtension) && std::all_of(name.begin(), name.end(), IsPlain);
  if (!plain) {
    const std::string what =
        "the name of a recording has letters, digits, '.', '_' and '-' only, does not begin with "
        "'.' and ends in .mcap";
    return Error(Reason::kArgumentInvalid, what, {{"name", what}});
  }
  const fs::path path = fs::path(path_) / name;
  std::error_code error;
  // A link could lead out of the directory.
  if (fs::symlink_status(path, error).type() != fs::file_type::regular) {
    return Error(Reason::kRecordingNotFound, absl::StrCat("no recording \"", name, "\""));
  }
  return path.string();
}

RecordingSource SourceOf(const std::shared_ptr<RecordingDirectory>& directory) {
  RecordingSource source;
  source.record = [directory](const std::string& session_id, const ReadScene& scene,
                              const Engine& engine) {
    return directory->Record(session_id, scene, engine);
  };
  source.list = [directory] { return directory->List(); };
  source.find = [directory](const std::string& name) { return directory->Find(name); };
  return source;
}

}  // namespace adhesim
