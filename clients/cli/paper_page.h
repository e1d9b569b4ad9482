#pragma once

#include <string>

#include "clients/cli/paper_report.h"

namespace adhesim {

// The report as one HTML page: claims with their verdicts first, then times, then each figure with
// its pictures and curves.
std::string PaperPage(const PaperReport& report);

}  // namespace adhesim
