#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "core/model/model.h"
#include "server/recording/recording_format.h"

namespace adhesim {

// Makes the model that was recorded, from the recording alone: its attachments are unpacked into a
// private temporary directory, under names of our own, and removed again. Errors: InvalidArgument
// with what is wrong with the scene; it comes from a file and is validated like any other.
absl::StatusOr<std::shared_ptr<const Model>> BuildRecordedModel(
    const RecordingBeginning& beginning);

}  // namespace adhesim
