#pragma once

#include <string>
#include <vector>

#include "clients/cli/about_machine.h"
#include "clients/cli/output.h"
#include "core/study/accuracy_study.h"

namespace adhesim {

struct AccuracyReport {
  AboutMachine machine;
  std::string file;         // the scene's, as it was named
  std::string description;  // the scene's own
  AccuracyStudy study;
};

// {"scene", "reference", "second_reference", "band", "points": [...], "orders", "recommendation",
// "left_out", "machine", ...}; lengths and forces in SI. What a scene does not have is left out.
Json AccuracyJson(const AccuracyReport& report);

// The recommendation in sentences, for people.
std::vector<std::string> AdviceText(const AccuracyStudy& study);

// The table and the recommendation, for a terminal.
std::string AccuracyText(const AccuracyReport& report);

// What a point was run with, as options of `adhesim run`; empty: none.
std::string SetOptions(const AccuracySetting& setting);

// What steps reported, in words; empty: nothing.
std::string BitsText(std::uint32_t bits);

}  // namespace adhesim
