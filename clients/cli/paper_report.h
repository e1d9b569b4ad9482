#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/cli/about_machine.h"
#include "clients/cli/output.h"
#include "clients/cli/take_pictures.h"
#include "core/study/paper_claims.h"
#include "core/study/paper_figures.h"
#include "core/study/paper_rivals.h"
#include "core/study/paper_study.h"

namespace adhesim {

// What became of one figure.
struct FigureReport {
  const PaperFigure* figure = nullptr;
  std::string description;  // the scene's own
  std::string not_run;      // why it was not run; empty: it was
  double duration_s = 0;    // simulated
  bool whole = true;        // that is the figure's own
  PaperStudy study;
  std::vector<Claim> claims;
  std::vector<Picture> pictures;  // at the instants that the run reached, or none
};

struct PaperReport {
  AboutMachine machine;
  std::string no_pictures;  // why there are none; empty: there are
  std::vector<FigureReport> figures;
  std::vector<RivalResult> rivals;  // empty: they were not asked for
  std::vector<Claim> rival_claims;
};

// One claim over every figure that makes it.
struct ClaimSummary {
  Claim worst;        // failing before not judged before holding; then the nearest to its limit
  std::string scene;  // of the worst; the id of a section of the page
  int judged = 0, held = 0;
};

// The section of the page that compares methods, and what asks for it on the command line.
inline constexpr char kRivals[] = "rivals";

// In the order in which figures first make them; then those of the comparison.
std::vector<ClaimSummary> Summarise(const PaperReport& report);

bool AnyFails(const PaperReport& report);
const char* VerdictText(Verdict verdict);
// Counts in full, other numbers with three digits.
std::string ShortNumber(double value);

// {"claims": [...], "compared": [...], "figures": [...], "machine": {...}}; what a figure does not
// have is left out.
Json PaperJson(const PaperReport& report);

// The claims for people, one a line.
std::string PaperText(const PaperReport& report);

}  // namespace adhesim
