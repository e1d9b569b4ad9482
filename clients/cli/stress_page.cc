#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>

#include "clients/cli/bullet_tissue.h"
#include "clients/cli/html_report.h"
#include "clients/cli/stress_report.h"

namespace adhesim {
namespace {

std::string Text(std::string_view text) { return HtmlEscape(text); }

constexpr char kStyle[] = R"(<style>
.matrix td { padding: 1px; border: 0; } .matrix th { padding: .1rem .6rem .1rem 0; border: 0; font-size: .85rem; }
.matrix thead th { text-align: center; padding: .1rem; font-weight: 400; }
.cell { display: block; width: 1.5rem; height: 1.3rem; border-radius: 3px; text-align: center;
  font-size: .75rem; line-height: 1.3rem; color: #fff; }
.survived { background: #1b7f4d; } .refused { background: #5b6b7c; } .frozen { background: #1f63b5; }
.failed { background: #c62828; } .none { background: transparent; }
.without { background: transparent; color: var(--soft); }
.key span.cell { display: inline-block; margin: 0 .3rem 0 1rem; }
</style>
)";

const char* Letter(std::string_view outcome) {
  if (outcome == "survived") return "\u2713";
  if (outcome == "refused") return "r";
  if (outcome == "frozen") return "f";
  if (outcome == kNotExpressible) return "\u2013";
  return "\u2717";
}

std::string Square(std::string_view outcome, std::string_view title) {
  const std::string_view style = outcome == kNotExpressible ? "without" : outcome;
  return absl::StrCat("<span class=\"cell ", Text(style), "\" title=\"", Text(title), "\">",
                      Letter(outcome), "</span>");
}

// Columns: the scene's own setting, Bullet's, then laws, integrators and steps, in the order of the
// first case that has them all.
std::vector<std::string> Columns(const StressReport& report) {
  std::vector<std::string> columns = {"default"};
  for (const BulletVariant& variant : kBulletVariants) {
    const auto has = [&](const StressCell& cell) { return cell.variant == variant.name; };
    if (std::any_of(report.bullet.begin(), report.bullet.end(), has)) {
      columns.emplace_back(variant.name);
    }
  }
  for (const StressCell& cell : report.cells) {
    if (std::find(columns.begin(), columns.end(), cell.variant) == columns.end()) {
      columns.push_back(cell.variant);
    }
  }
  return columns;
}

std::string Matrix(const StressReport& report) {
  const std::vector<std::string> columns = Columns(report);
  std::string html = "<div class=\"scroll\"><table class=\"matrix\"><thead><tr><th></th>";
  for (const std::string& column : columns) {
    absl::StrAppend(&html, "<th scope=\"col\" title=\"", Text(column),
                    "\"><div style=\"writing-mode: vertical-rl\">", Text(column), "</div></th>");
  }
  absl::StrAppend(&html, "</tr></thead>\n<tbody>");
  for (const StressCase& one : StressCases()) {
    std::string row;
    bool any = false;
    for (const std::string& column : columns) {
      const StressCell* cell = report.Find(one.name, column);
      any = any || cell != nullptr;
      absl::StrAppend(
          &row, "<td>",
          cell == nullptr
              ? "<span class=\"cell none\"></span>"
              : Square(cell->outcome, absl::StrCat(cell->variant, ": ", cell->outcome,
                                                   cell->cause.empty() ? "" : ": ", cell->cause)),
          "</td>");
    }
    if (!any) continue;
    absl::StrAppend(&html, "<tr><th scope=\"row\" title=\"", Text(one.title), "\">", Text(one.name),
                    "</th>", row, "</tr>\n");
  }
  return html + "</tbody></table></div>\n";
}

std::string Counts(const StressReport& report) {
  std::string html = "<p class=\"key\"><strong>";
  absl::StrAppend(&html, report.cells.size(), " cells</strong>:");
  static constexpr std::pair<const char*, const char*> kOutcomes[] = {
      {"survived", "survived"},
      {"refused", "refused when loaded"},
      {"frozen", "detected, named and frozen"},
      {"failed", "failed"}};
  for (const auto& [outcome, words] : kOutcomes) {
    absl::StrAppend(&html, Square(outcome, words), report.Count(outcome), " ", words);
  }
  return html + "</p>\n";
}

std::string BulletCounts(const StressReport& report) {
  std::string html;
  for (const BulletVariant& variant : kBulletVariants) {
    const int survived = report.CountBullet(variant.name, "survived");
    const int failed = report.CountBullet(variant.name, "failed");
    if (survived + failed == 0) continue;
    int both = 0;  // of those, that ours survives
    for (const StressCell& cell : report.bullet) {
      if (cell.variant != variant.name || cell.outcome == kNotExpressible) continue;
      const StressCell* ours = report.Find(cell.stress_case, "default");
      both += ours != nullptr && ours->outcome == "survived";
    }
    absl::StrAppend(&html, "<p class=\"key\"><strong>", BulletTissue::version(), ", ",
                    variant.dt_s ? "steps of 1 ms" : "the scenes' own steps", "</strong>: of ",
                    survived + failed, " cases that it can express ", survived, " survived and ",
                    failed, " failed; ours survives ", both, " of these. ",
                    report.CountBullet(variant.name, kNotExpressible), " not expressible.</p>\n");
  }
  return html;
}

// The cases that both have, side by side.
std::string BesideBullet(const StressReport& report) {
  HtmlTable table{"", {"case", "ours"}, {false, false}, {}};
  for (const BulletVariant& variant : kBulletVariants) {
    table.headers.push_back(Text(variant.name));
    table.numeric.push_back(false);
  }
  for (const StressCase& one : StressCases()) {
    const StressCell* ours = report.Find(one.name, "default");
    std::vector<std::string> row = {Text(one.name), ours == nullptr ? "" : Text(ours->outcome)};
    bool expressible = false;
    for (const BulletVariant& variant : kBulletVariants) {
      const StressCell* cell = report.Find(one.name, variant.name);
      expressible = expressible || (cell != nullptr && cell->outcome != kNotExpressible);
      const std::string cause = cell == nullptr || cell->cause.empty() ? "" : ": " + cell->cause;
      row.push_back(cell == nullptr ? "" : Text(cell->outcome + cause));
    }
    if (expressible) table.rows.push_back(std::move(row));
  }
  if (table.rows.empty()) return "";
  return absl::StrCat(
      "<h2>Beside Bullet</h2>\n", ToHtml(table), "<p class=\"soft\">", BulletTissue::version(),
      ": ", BulletTissue::settings_text(),
      ". Implicit steps, as in its own demo of volumes; vertices and faces touch, with obstacles "
      "by "
      "their distance field. Judged like ours, but for books and forces of tools, which it does "
      "not have, and for energy where bodies overlap at the start.</p>\n");
}

std::string Torture(const TortureReport& torture) {
  if (torture.scenes == 0) return "";
  std::string html = absl::StrFormat(
      "<h2>Torture</h2>\n<p>%d random scenes from seed %d, %.0f simulated seconds: %d survived, %d "
      "refused when loaded (explicit steps that need more than 500 sub-steps), <strong>%d "
      "failed</strong>.</p>\n",
      torture.scenes, torture.first_seed, torture.simulated_s, torture.survived, torture.refused,
      torture.failures.size());
  if (torture.failures.empty()) return html;
  HtmlTable table{"", {"seed", "what does not hold"}, {false, false}, {}};
  for (const TortureReport::Failure& failure : torture.failures) {
    table.rows.push_back({absl::StrCat(failure.seed), Text(failure.cause)});
  }
  return html + ToHtml(table);
}

std::string Number(const Json& figures, const char* key) {
  const auto at = figures.find(key);
  if (at == figures.end()) return "\u2013";
  return at->is_number() ? absl::StrFormat("%.2g", at->get<double>()) : "never";
}

// Cases at their own setting, with what decides.
std::string Figures(const StressReport& report) {
  HtmlTable table{
      "At the scene's own setting. Energy above what was put in, imbalance of a "
      "sub-step and the adhesive's share are over E_ref.",
      {"case", "what is hard", "outcome", "steps", "energy", "imbalance", "adhesive", "depth, mm",
       "force, N", "at rest, s", "CPU, s"},
      {false, false, false, true, true, true, true, true, true, true, true},
      {}};
  for (const StressCase& one : StressCases()) {
    const StressCell* cell = report.Find(one.name, "default");
    if (cell == nullptr) continue;
    const Json& f = cell->figures;
    std::string depth = Number(f, "max_depth_m");
    if (f.contains("max_depth_m")) {
      depth = absl::StrFormat("%.2g", 1e3 * f["max_depth_m"].get<double>());
    }
    table.rows.push_back(
        {Text(one.name), Text(one.title), Square(cell->outcome, cell->outcome), Number(f, "steps"),
         Number(f, "energy_excess"), Number(f, "identity_error"), Number(f, "adhesive_share"),
         depth, Number(f, "peak_force_n"),
         one.conditions.rest_by_s ? Number(f, "rest_since_s") : "\u2013", Number(f, "cpu_s")});
  }
  return ToHtml(table);
}

// Refusals of too long explicit steps are in the matrix; the rest is told in words.
std::string NotSurvived(const StressReport& report) {
  HtmlTable table{"", {"case", "setting", "outcome", "cause"}, {false, false, false, false}, {}};
  for (const StressCell& cell : report.cells) {
    if (cell.outcome == "survived") continue;
    if (cell.outcome == "refused" && cell.variant != "default") continue;
    std::string cause = Text(cell.cause);
    for (const StressCase& one : StressCases()) {
      if (one.open == nullptr || one.name != cell.stress_case || cell.variant != "default")
        continue;
      absl::StrAppend(&cause, "<br><span class=\"soft\">", Text(one.open), "</span>");
    }
    table.rows.push_back({Text(cell.stress_case), Text(cell.variant), Text(cell.outcome), cause});
  }
  if (table.rows.empty()) return "";
  return absl::StrCat("<h2>What is not survived</h2>\n", ToHtml(table));
}

}  // namespace

std::string StressPage(const StressReport& report) {
  const AboutMachine& machine = report.machine;
  std::string body = absl::StrCat(
      kStyle, "<h1>Hard cases</h1>\n<p class=\"soft\">adhesim ", Text(machine.version), ", commit ",
      Text(machine.commit), ", ", Text(machine.build), "; ", Text(machine.processor), "; ",
      Text(machine.date), "</p>\n", Counts(report), BulletCounts(report),
      "<p>A case is survived when the state stays finite, energy never exceeds what was put in by "
      "more than 1 % of E_ref, the books balance and the adhesive adds nothing to 1e-9, bodies lie "
      "in each other no deeper than the capture distance (or than at the start, and come out), no "
      "tool pierces anything, tools' forces stay within their limits, and what is free has its "
      "shape again in time. Point at a square to read why.</p>\n",
      Matrix(report), BesideBullet(report), Torture(report.torture), NotSurvived(report),
      "<h2>Figures</h2>\n", Figures(report));
  return HtmlPage("adhesim: hard cases", body);
}

}  // namespace adhesim
