#pragma once

#include <string>
#include <vector>

#include "core/study/paper_figures.h"
#include "core/study/paper_study.h"

namespace adhesim {

enum class Verdict {
  kHolds,
  kFails,
  kNotJudged,  // the run was too short for it
};

enum class Relation { kAtMost, kAtLeast, kIs };

// Something that can be wrong, with the number that decides it.
struct Claim {
  std::string id;       // the same claim has the same one in every figure
  std::string subject;  // what the number is
  std::string unit;     // empty: a pure number
  double value = 0;
  Relation relation = Relation::kAtMost;
  double limit = 0;
  Verdict verdict = Verdict::kNotJudged;
};

// A claim with its verdict. Not a number never holds.
Claim Judged(std::string id, std::string subject, std::string unit, double value, Relation relation,
             double limit);

// What a figure claims, judged by a run. `whole`: the run had the figure's full length; otherwise
// what only its end can show is not judged. A run that became non-finite fails its first claim.
std::vector<Claim> JudgeFigure(const PaperFigure& figure, const PaperStudy& study, bool whole);

// "at most 1e-09"
std::string LimitText(const Claim& claim);

}  // namespace adhesim
