#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/scene/scene_file.h"
#include "core/study/accuracy_settings.h"

namespace adhesim {

// Errors of rungs at the setting that is written; none: they were not measured at it.
struct RungsEntry {
  v1::Rungs rungs;
  std::string comment;  // how they were measured, one line
};

// The file's text with edits of `rate_hz` and of fields of `integration` written into it, and these
// rungs in the place of its own; every other byte stays: comments, order, layout. The result reads
// as the edited scene and nothing else. Errors (FailedPrecondition): text in which it cannot be
// done that way, such as JSON or aliases; nothing is lost by editing it by hand.
absl::StatusOr<std::string> TextWithEdits(const SceneFile& file,
                                          const std::vector<SceneEdit>& edits,
                                          const RungsEntry& rungs = {});

}  // namespace adhesim
