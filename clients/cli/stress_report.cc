#include "clients/cli/stress_report.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>

#include "clients/cli/bullet_tissue.h"

namespace adhesim {
namespace {

// What a file is called until it is whole.
constexpr char kPart[] = ".part";

// JSON has no infinity: what never came back is null.
Json Finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json FiguresJson(const StressFigures& f) {
  Json json = {{"particles", f.particles},
               {"dt_s", f.dt_s},
               {"substeps", f.substeps},
               {"steps", f.steps},
               {"simulated_s", f.simulated_s},
               {"cpu_s", f.cpu_s},
               {"report_bits", f.bits},
               {"energy_excess", Finite(f.energy_excess)},
               {"excess_j", Finite(f.excess_j)},
               {"identity_error", Finite(f.identity_error)},
               {"adhesive_share", Finite(f.adhesive_share)},
               {"sliding_gained_share", Finite(f.sliding_share)},
               {"sliding_share", Finite(f.slid_share)},
               {"max_depth_m", f.max_depth_m},
               {"end_depth_m", f.end_depth_m},
               {"overlap_m", f.overlap_m},
               {"captures", f.captures},
               {"releases", f.releases},
               {"most_zones", f.most_zones},
               {"shape_error", Finite(f.end_shape_error)},
               {"rest_since_s", Finite(f.rest_since_s)}};
  if (f.capture_distance_m > 0) json["capture_distance_m"] = f.capture_distance_m;
  if (f.peak_force_n > 0) {
    json["peak_force_n"] = f.peak_force_n;
    json["force_over"] = Finite(f.force_over);
    json["coupling_over"] = Finite(f.coupling_over);
    json["pierced"] = f.pierced;
  }
  return json;
}

Json TortureJson(const TortureReport& torture) {
  Json failures = Json::array();
  for (const TortureReport::Failure& failure : torture.failures) {
    failures.push_back({{"seed", failure.seed}, {"cause", failure.cause}, {"scene", failure.file}});
  }
  return {{"first_seed", torture.first_seed},
          {"scenes", torture.scenes},
          {"survived", torture.survived},
          {"refused", torture.refused},
          {"simulated_s", torture.simulated_s},
          {"cpu_s", torture.cpu_s},
          {"failures", failures}};
}

Json CellsJson(const std::vector<StressCell>& cells) {
  Json list = Json::array();
  for (const StressCell& cell : cells) {
    Json json = {{"case", cell.stress_case}, {"setting", cell.variant}, {"outcome", cell.outcome}};
    if (!cell.cause.empty()) json["cause"] = cell.cause;
    json["commit"] = cell.commit;
    json["figures"] = cell.figures;
    list.push_back(std::move(json));
  }
  return list;
}

Json BulletJson(const StressReport& report) {
  Json counts = Json::object();
  for (const BulletVariant& variant : kBulletVariants) {
    for (const char* outcome : {OutcomeName(StressOutcome::kSurvived),
                                OutcomeName(StressOutcome::kFailed), kNotExpressible}) {
      counts[variant.name][outcome] = report.CountBullet(variant.name, outcome);
    }
  }
  return {{"version", BulletTissue::version()},
          {"about", BulletTissue::settings_text()},
          {"counts", counts},
          {"cells", CellsJson(report.bullet)}};
}

// Nothing: it is no list of cells.
std::optional<std::vector<StressCell>> CellsOf(const Json& list) {
  if (!list.is_array()) return std::nullopt;
  std::vector<StressCell> cells;
  for (const Json& cell : list) {
    const auto text = [&](const char* key) {
      const auto at = cell.find(key);
      return at != cell.end() && at->is_string() ? at->get<std::string>() : std::string();
    };
    if (!cell.is_object() || text("case").empty() || text("outcome").empty()) return std::nullopt;
    cells.push_back({text("case"), text("setting"), text("outcome"), text("cause"), text("commit"),
                     cell.value("figures", Json::object())});
  }
  return cells;
}

}  // namespace

const StressCell* StressReport::Find(std::string_view stress_case, std::string_view variant) const {
  for (const std::vector<StressCell>* list : {&cells, &bullet}) {
    for (const StressCell& cell : *list) {
      if (cell.stress_case == stress_case && cell.variant == variant) return &cell;
    }
  }
  return nullptr;
}

int StressReport::Count(std::string_view outcome) const {
  return static_cast<int>(std::count_if(
      cells.begin(), cells.end(), [&](const StressCell& cell) { return cell.outcome == outcome; }));
}

int StressReport::CountBullet(std::string_view variant, std::string_view outcome) const {
  return static_cast<int>(std::count_if(bullet.begin(), bullet.end(), [&](const StressCell& cell) {
    return cell.variant == variant && cell.outcome == outcome;
  }));
}

std::vector<std::string> StressReport::BulletVariants() const {
  std::vector<std::string> names;
  for (const BulletVariant& variant : kBulletVariants) {
    const auto has = [&](const StressCell& cell) { return cell.variant == variant.name; };
    if (std::any_of(bullet.begin(), bullet.end(), has)) names.emplace_back(variant.name);
  }
  return names;
}

StressCell BulletCellOf(const StressCase& stress_case, const BulletVariant& variant,
                        const BulletCase& bullet_case, const std::string& commit) {
  const std::string& why = bullet_case.not_expressible;
  const StressResult& result = bullet_case.result;
  StressCell cell{stress_case.name,
                  variant.name,
                  why.empty() ? OutcomeName(result.outcome) : kNotExpressible,
                  why.empty() ? result.cause : why,
                  commit,
                  Json::object()};
  const StressFigures& f = result.figures;
  if (f.steps == 0) return cell;
  cell.figures = {{"dt_s", f.dt_s},
                  {"steps", f.steps},
                  {"simulated_s", f.simulated_s},
                  {"cpu_s", f.cpu_s},
                  {"energy_excess", Finite(f.energy_excess)},
                  {"max_depth_m", f.max_depth_m},
                  {"shape_error", Finite(f.end_shape_error)},
                  {"rest_since_s", Finite(f.rest_since_s)}};
  return cell;
}

StressCell CellOf(const StressCase& stress_case, const StressVariant& variant,
                  const StressResult& result, const std::string& commit) {
  StressCell cell{stress_case.name, VariantName(variant), OutcomeName(result.outcome), result.cause,
                  commit,           Json::object()};
  if (result.figures.steps > 0) cell.figures = FiguresJson(result.figures);
  return cell;
}

Json StressJson(const StressReport& report) {
  Json counts = Json::object();
  for (const StressOutcome outcome : {StressOutcome::kSurvived, StressOutcome::kRefused,
                                      StressOutcome::kFrozen, StressOutcome::kFailed}) {
    counts[OutcomeName(outcome)] = report.Count(OutcomeName(outcome));
  }
  const AboutMachine& machine = report.machine;
  Json json = {{"counts", counts},
               {"machine",
                {{"processor", machine.processor},
                 {"cores", machine.cores},
                 {"version", machine.version},
                 {"build", machine.build},
                 {"commit", machine.commit},
                 {"date", machine.date}}}};
  if (report.torture.scenes > 0) json["torture"] = TortureJson(report.torture);
  if (!report.bullet.empty()) json["bullet"] = BulletJson(report);
  json["cells"] = CellsJson(report.cells);
  return json;
}

absl::StatusOr<StressReport> ReadStressCells(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(absl::StrCat("cannot read ", path));
  const Json json = Json::parse(file, nullptr, false);
  const Json bullet = json.is_object() ? json.value("bullet", Json::object()) : Json();
  const auto cells = json.is_object() ? CellsOf(json.value("cells", Json())) : std::nullopt;
  const auto theirs =
      bullet.is_object() ? CellsOf(bullet.value("cells", Json::array())) : std::nullopt;
  if (!cells || !theirs) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " is no report of `adhesim stress`; name another file, or remove it"));
  }
  StressReport report;
  report.cells = *cells;
  report.bullet = *theirs;
  return report;
}

absl::Status CheckReplaceable(const std::string& path) {
  std::error_code error;
  const absl::Status writable = CheckWritable(path + kPart);
  std::filesystem::remove(path + kPart, error);
  if (writable.ok() && !std::filesystem::is_directory(path, error)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("cannot write ", path));
}

absl::Status WriteStressFile(const std::string& path, const std::string& text) {
  std::error_code error;
  const absl::Status written = WriteTextFile(path + kPart, text);
  if (written.ok()) std::filesystem::rename(path + kPart, path, error);
  if (written.ok() && !error) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("cannot write ", path));
}

std::string StressLine(const StressCell& cell) {
  std::string line =
      absl::StrFormat("%-9s %-24s %-32s", cell.outcome, cell.stress_case, cell.variant);
  if (cell.figures.contains("cpu_s")) {
    absl::StrAppendFormat(&line, "%7.2f s", cell.figures["cpu_s"].get<double>());
  }
  if (!cell.cause.empty()) absl::StrAppend(&line, "  ", cell.cause);
  return line + "\n";
}

}  // namespace adhesim
