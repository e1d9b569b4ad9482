#include "clients/cli/paper_report.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

// How near a claim is to failing, or how far beyond: larger is worse.
double Badness(const Claim& claim) {
  if (claim.relation == Relation::kIs) return std::abs(claim.value - claim.limit);
  return claim.relation == Relation::kAtMost ? claim.value : -claim.value;
}

bool IsWorse(const Claim& claim, const Claim& than) {
  const auto rank = [](const Claim& c) {
    return c.verdict == Verdict::kFails ? 2 : c.verdict == Verdict::kHolds ? 1 : 0;
  };
  if (rank(claim) != rank(than)) return rank(claim) > rank(than);
  return !(Badness(claim) <= Badness(than));
}

const char* RelationText(Relation relation) {
  switch (relation) {
    case Relation::kAtMost:
      return "at_most";
    case Relation::kAtLeast:
      return "at_least";
    case Relation::kIs:
      return "is";
  }
  return "";
}

const char* VerdictWord(Verdict verdict) {
  switch (verdict) {
    case Verdict::kHolds:
      return "holds";
    case Verdict::kFails:
      return "fails";
    case Verdict::kNotJudged:
      return "not_judged";
  }
  return "";
}

Json ClaimJson(const Claim& claim) {
  Json json = {{"id", claim.id},       {"subject", claim.subject},
               {"value", claim.value}, {"relation", RelationText(claim.relation)},
               {"limit", claim.limit}, {"verdict", VerdictWord(claim.verdict)}};
  if (!claim.unit.empty()) json["unit"] = claim.unit;
  return json;
}

Json SampleJson(const StudySample& sample, int particles) {
  Json json = {{"time_s", sample.time_s},
               {"cpu_ms", sample.cpu_ms},
               {"colliding_particles", sample.colliding_particles},
               {"colliding_share", static_cast<double>(sample.colliding_particles) / particles},
               {"zones", sample.zones},
               {"energy_j", sample.energy_j},
               {"permitted_j", sample.permitted_j},
               {"contact_added_j", sample.contact_added_j},
               {"captured_j", sample.captured_j},
               {"viscous_j", sample.viscous_j},
               {"slid_j", sample.slid_j},
               {"pushed_j", sample.pushed_j},
               {"radius_m", sample.radius_m}};
  if (sample.separation_m) json["separation_m"] = *sample.separation_m;
  if (sample.revolutions) {
    json["revolutions"] = *sample.revolutions;
    json["travel_m"] = *sample.travel_m;
    json["slip_m"] = *sample.slip_m;
  }
  if (sample.bodies_energy_j) json["bodies_energy_j"] = *sample.bodies_energy_j;
  if (sample.moved_m) {
    json["moved_m"] = *sample.moved_m;
    json["speed_m_s"] = *sample.speed_m_s;
  }
  if (sample.mean_gap_m) json["mean_gap_m"] = *sample.mean_gap_m;
  if (sample.volume_error) json["volume_error"] = *sample.volume_error;
  if (sample.max_depth_m) json["max_depth_m"] = *sample.max_depth_m;
  if (sample.vertices_inside) json["vertices_inside"] = *sample.vertices_inside;
  return json;
}

Json PaperNumbersJson(const PaperFigure& figure) {
  Json json = Json::object();
  if (figure.particles) json["particles"] = *figure.particles;
  if (figure.triangles) json["triangles"] = *figure.triangles;
  if (figure.paper_ms) json[figure.paper_ms_is_bound ? "ms_below" : "ms"] = *figure.paper_ms;
  return json;
}

Json FigureJson(const FigureReport& report) {
  const PaperFigure& figure = *report.figure;
  Json json = {{"scene", figure.scene}, {"figure", figure.figure}, {"title", figure.title}};
  if (const Json paper = PaperNumbersJson(figure); !paper.empty()) json["paper"] = paper;
  if (!report.not_run.empty()) {
    json["not_run"] = report.not_run;
    return json;
  }
  const PaperStudy& study = report.study;
  json["duration_s"] = report.duration_s;
  json["whole"] = report.whole;
  json["steps"] = study.steps;
  json["dt_s"] = study.dt_s;
  json["bodies"] = study.bodies;
  json["particles"] = study.particles;
  json["triangles"] = study.triangles;
  json["cpu_ms_per_step"] = {{"median", study.cpu_ms_median}, {"p99", study.cpu_ms_p99}};
  json["colliding_share_timed"] = study.second_half_colliding / study.particles;
  if (figure.budget_ms) json["budget_ms"] = *figure.budget_ms;
  json["reference_j"] = study.reference_j;
  json["claims"] = Json::array();
  for (const Claim& claim : report.claims) json["claims"].push_back(ClaimJson(claim));
  json["instants"] = Json::array();
  for (const StudyInstant& instant : study.instants) {
    json["instants"].push_back(
        {{"time_s", instant.time_s}, {"colliding_particles", instant.colliding_particles}});
  }
  json["pictures"] = report.pictures.size();
  json["samples"] = Json::array();
  for (const StudySample& sample : study.samples) {
    json["samples"].push_back(SampleJson(sample, study.particles));
  }
  return json;
}

Json RivalJson(const RivalResult& result) {
  const Rival& rival = *result.rival;
  Json json = {{"id", rival.id}, {"scene", rival.scene}, {"method", rival.name}};
  json["settings"] = Json::array();
  for (const std::string_view setting : rival.settings) json["settings"].push_back(setting);
  json["runs"] = Json::array();
  for (const RivalRun& run : result.runs) {
    json["runs"].push_back({{"rate_hz", run.rate_hz},
                            {"substeps", run.substeps},
                            {"finite", run.study.finite},
                            {"whole_excess", EnergyExcess(run.study)},
                            {"bodies_excess", BodiesExcess(run.study)},
                            {"max_depth_m", GreatestDepth(run.study)},
                            {"parted_to_m", PartedTo(run.study)},
                            {"identity_error", run.study.identity_error},
                            {"cpu_ms_per_step", run.study.cpu_ms_median}});
  }
  return json;
}

}  // namespace

std::vector<ClaimSummary> Summarise(const PaperReport& report) {
  std::vector<ClaimSummary> summaries;
  for (const FigureReport& figure : report.figures) {
    for (const Claim& claim : figure.claims) {
      auto at = std::find_if(summaries.begin(), summaries.end(), [&](const ClaimSummary& summary) {
        return summary.worst.id == claim.id;
      });
      if (at == summaries.end()) {
        at = summaries.insert(at, {claim, std::string(figure.figure->scene), 0, 0});
      } else if (IsWorse(claim, at->worst)) {
        at->worst = claim;
        at->scene = figure.figure->scene;
      }
      at->judged += claim.verdict != Verdict::kNotJudged;
      at->held += claim.verdict == Verdict::kHolds;
    }
  }
  // Each is made once.
  for (const Claim& claim : report.rival_claims) {
    summaries.push_back(
        {claim, kRivals, claim.verdict != Verdict::kNotJudged, claim.verdict == Verdict::kHolds});
  }
  return summaries;
}

bool AnyFails(const PaperReport& report) {
  const auto any_fails = [](const std::vector<Claim>& claims) {
    return std::any_of(claims.begin(), claims.end(),
                       [](const Claim& claim) { return claim.verdict == Verdict::kFails; });
  };
  return any_fails(report.rival_claims) ||
         std::any_of(report.figures.begin(), report.figures.end(),
                     [&](const FigureReport& figure) { return any_fails(figure.claims); });
}

const char* VerdictText(Verdict verdict) {
  switch (verdict) {
    case Verdict::kHolds:
      return "holds";
    case Verdict::kFails:
      return "does not hold";
    case Verdict::kNotJudged:
      return "not judged";
  }
  return "";
}

std::string ShortNumber(double value) {
  constexpr double kLargestCount = 1e7;
  const bool count = std::abs(value) < kLargestCount && value == std::floor(value);
  return count ? absl::StrFormat("%.0f", value) : absl::StrFormat("%.3g", value);
}

Json PaperJson(const PaperReport& report) {
  const AboutMachine& machine = report.machine;
  Json json;
  json["holds"] = !AnyFails(report);
  json["machine"] = {{"processor", machine.processor},
                     {"cores", machine.cores},
                     {"load", machine.load},
                     {"version", machine.version},
                     {"build", machine.build},
                     {"commit", machine.commit},
                     {"date", machine.date}};
  if (!report.no_pictures.empty()) json["no_pictures"] = report.no_pictures;
  json["claims"] = Json::array();
  for (const ClaimSummary& summary : Summarise(report)) {
    Json claim = ClaimJson(summary.worst);
    claim["scene"] = summary.scene;
    claim["judged"] = summary.judged;
    claim["held"] = summary.held;
    json["claims"].push_back(std::move(claim));
  }
  if (!report.rivals.empty()) {
    json["compared"] = Json::array();
    for (const RivalResult& rival : report.rivals) json["compared"].push_back(RivalJson(rival));
  }
  json["figures"] = Json::array();
  for (const FigureReport& figure : report.figures) json["figures"].push_back(FigureJson(figure));
  return json;
}

std::string PaperText(const PaperReport& report) {
  std::string text;
  for (const ClaimSummary& summary : Summarise(report)) {
    absl::StrAppend(&text,
                    absl::StrFormat("%-14s %-62s %10s (%s) in %s, %d of %d\n",
                                    VerdictText(summary.worst.verdict), summary.worst.subject,
                                    ShortNumber(summary.worst.value), LimitText(summary.worst),
                                    summary.scene, summary.held, summary.judged));
  }
  for (const FigureReport& figure : report.figures) {
    if (figure.not_run.empty()) continue;
    absl::StrAppend(&text, "not run        ", std::string(figure.figure->scene), ": ",
                    figure.not_run, "\n");
  }
  return text;
}

}  // namespace adhesim
