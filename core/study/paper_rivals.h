#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "core/study/paper_claims.h"
#include "core/study/paper_study.h"

namespace adhesim {

// A method of contact that is compared with the others on one scene: two cells fall into a common
// well, where nothing but contact takes energy or brings it (scenes/paper/rivals/).
struct Rival {
  std::string_view id;     // among the others
  std::string_view scene;  // file below the directory of scenes, without ".yaml"
  std::string_view name;
  bool pulls = true;                           // can hold what would part
  std::span<const std::string_view> settings;  // of the scene's fields, "path=value"
};

// The virtual adhesive first.
std::span<const Rival> PaperRivals();

// Every method is run at each, ascending: what is the step's fault vanishes with it.
std::span<const int> RivalRatesHz();

inline constexpr double kRivalsDurationS = 1.2;

struct RivalRun {
  int rate_hz = 0;
  int substeps = 0;  // of a step, by the stability bound
  PaperStudy study;
};

struct RivalResult {
  const Rival* rival = nullptr;
  std::vector<RivalRun> runs;  // one a rate, ascending
};

// Greatest distance of the bodies' centres after they were nearest to each other, m: bodies that
// stick stay together.
double PartedTo(const PaperStudy& study);

// Greatest depth of a particle in the other body, m; 0 where none was measured.
double GreatestDepth(const PaperStudy& study);

// That the adhesive adds no energy at any rate, and that the methods that the paper names do.
std::vector<Claim> JudgeRivals(const std::vector<RivalResult>& results);

}  // namespace adhesim
