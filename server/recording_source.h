#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <string>

#include "adhesim/v1/recording_service.pb.h"
#include "core/engine/engine.h"
#include "server/scene_source.h"
#include "server/step_observer.h"

namespace adhesim {

// Where recordings go and come from: handed to the server by the program, so that the server does
// not know their format. Empty functions: the server keeps none. Called from several threads at
// once.
struct RecordingSource {
  // Begins the recording of a new session.
  std::function<absl::StatusOr<std::shared_ptr<StepObserver>>(
      const std::string& session_id, const ReadScene& scene, const Engine& engine)>
      record;
  // The recordings there are, in order of name.
  std::function<v1::ListRecordingsResponse()> list;
  // The path of a recording's file. Errors: ArgumentInvalid (a name that leaves the directory),
  // RecordingNotFound.
  std::function<absl::StatusOr<std::string>(const std::string& name)> find;
};

}  // namespace adhesim
