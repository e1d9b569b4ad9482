#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "adhesim/v1/recording_service.pb.h"
#include "server/recording/recorder.h"
#include "server/recording_source.h"

namespace adhesim {

// The folder in which a server keeps its recordings. Thread-safe.
class RecordingDirectory {
 public:
  // Makes the folder when there is none. Errors: InvalidArgument.
  static absl::StatusOr<std::shared_ptr<RecordingDirectory>> Open(const std::string& path,
                                                                  const Recorder::Options& options,
                                                                  const std::string& version,
                                                                  const std::string& build);

  // Begins SCENE-SESSION.mcap.
  absl::StatusOr<std::shared_ptr<StepObserver>> Record(const std::string& session_id,
                                                       const ReadScene& scene,
                                                       const Engine& engine);
  v1::ListRecordingsResponse List() const;
  // The path of a recording by its file name. Errors: ArgumentInvalid for anything but a plain name
  // that ends in .mcap, RecordingNotFound.
  absl::StatusOr<std::string> Find(const std::string& name) const;

 private:
  RecordingDirectory(std::string path, Recorder::Options options, std::string version,
                     std::string build);

  const std::string path_;
  const Recorder::Options options_;
  const std::string version_, build_;

  // Guards the rest. A standard mutex: thread sanitizers do not see through Abseil's as packaged.
  mutable std::mutex mutex_;
  struct Own {
    std::string session;
    std::weak_ptr<Recorder> recorder;
  };
  std::map<std::string, Own> own_;  // by file name: those that this run of the server began
};

// The directory's functions, as the server wants them.
RecordingSource SourceOf(const std::shared_ptr<RecordingDirectory>& directory);

// A file name's worth of a text: letters, digits, '.', '_' and '-', at most 64, no dot in front.
std::string FileNamePart(const std::string& text);

}  // namespace adhesim
