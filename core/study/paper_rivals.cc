#include "core/study/paper_rivals.h"

#include <algorithm>
#include <array>

namespace adhesim {
namespace {

// The project's bound on what an explicit step may have above what it got; more than that is added.
constexpr double kAddedShare = 0.01;

// As stiff as the penalty beside them, so that they pull as hard at their greatest length:
// 1800 N/m (24 mm - 12 mm) = 21.6 N.
constexpr std::array<std::string_view, 2> kMadeAtRest = {
    "effects[4].elastic_links.rest_length_m=0.012", "effects[4].elastic_links.stiffness_n_m=1800"};

constexpr Rival kRivals[] = {
    {"adhesive", "rivals/adhesive", "virtual adhesive", true, {}},
    {"penalty", "rivals/penalty", "penalty forces", false, {}},
    {"links", "rivals/links", "elastic links", true, {}},
    {"links_at_rest", "rivals/links", "unstretched links", true, kMadeAtRest},
    {"impulses", "rivals/impulses", "attraction impulses", true, {}},
};

constexpr int kRatesHz[] = {1000, 4000, 16000};

}  // namespace

std::span<const Rival> PaperRivals() { return kRivals; }

std::span<const int> RivalRatesHz() { return kRatesHz; }

double PartedTo(const PaperStudy& study) {
  const auto separation_m = [](const StudySample& sample) {
    return sample.separation_m.value_or(0);
  };
  const auto nearest = std::ranges::min_element(study.samples, std::ranges::less{}, separation_m);
  double furthest_m = 0;
  for (auto at = nearest; at != study.samples.end(); ++at) {
    furthest_m = std::max(furthest_m, separation_m(*at));
  }
  return furthest_m;
}

double GreatestDepth(const PaperStudy& study) {
  double depth_m = 0;
  for (const StudySample& sample : study.samples) {
    depth_m = std::max(depth_m, sample.max_depth_m.value_or(0));
  }
  return depth_m;
}

std::vector<Claim> JudgeRivals(const std::vector<RivalResult>& results) {
  std::vector<Claim> claims;
  for (const RivalResult& result : results) {
    if (result.runs.empty()) continue;
    if (result.rival->id == "adhesive") {
      double most = 0;
      for (const RivalRun& run : result.runs) most = std::max(most, EnergyExcess(run.study));
      claims.push_back(Judged("adhesive_adds_none",
                              "compared: energy that the adhesive adds, at any rate, of E_ref", "",
                              most, Relation::kAtMost, kAddedShare));
    } else if (result.rival->id == "links") {
      claims.push_back(
          Judged("links_add", "compared: energy that links add at the highest rate, of E_ref", "",
                 EnergyExcess(result.runs.back().study), Relation::kAtLeast, kAddedShare));
    } else if (result.rival->id == "impulses") {
      claims.push_back(
          Judged("impulses_add", "compared: energy that impulses add at the lowest rate, of E_ref",
                 "", EnergyExcess(result.runs.front().study), Relation::kAtLeast, kAddedShare));
    }
  }
  return claims;
}

}  // namespace adhesim
