#pragma once

#include <string>

#include "clients/cli/headless_run.h"
#include "clients/cli/output.h"

namespace adhesim {

// The result of `run` as the contract names its fields; what the scene does not have is left out.
Json RunReportJson(const Engine& engine, const RunOptions& options, const RunStatistics& statistics,
                   int threads);

// The same for people, a line for each subject.
std::string RunReportText(const Json& report);

// The stages with the median of their times and their share of the sum, in the pipeline's order.
Json StagesJson(const Engine& engine);

}  // namespace adhesim
