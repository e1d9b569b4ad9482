#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "clients/cli/accuracy_report.h"

namespace adhesim {

// The report as one page that stands alone: work-precision diagrams, error against dt, tables, the
// recommendation, machine and commit.
std::string AccuracyPage(const AccuracyReport& report);

// Its first diagram as a picture that stands alone.
absl::StatusOr<std::string> AccuracyPicture(const AccuracyReport& report);

}  // namespace adhesim
