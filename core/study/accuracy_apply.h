#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/scene/scene_file.h"
#include "core/study/accuracy_settings.h"

namespace adhesim {

// The file's text with edits of `rate_hz` and of fields of `integration` written into it; every
// other byte stays: comments, order, layout. The result reads as the edited scene and nothing else.
// Errors (FailedPrecondition): text in which it cannot be done that way, such as JSON or aliases;
// nothing is lost by editing it by hand.
absl::StatusOr<std::string> TextWithEdits(const SceneFile& file,
                                          const std::vector<SceneEdit>& edits);

}  // namespace adhesim
