#include "clients/cli/paper_page.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <string_view>

#include "clients/cli/html_report.h"
#include "clients/cli/paper_plots.h"

namespace adhesim {
namespace {

// Every text goes through here on its way into the page.
std::string Text(std::string_view text) { return HtmlEscape(text); }

std::string Number(double value) { return absl::StrFormat("%.3g", value); }

std::string Paragraph(std::string_view html, std::string_view kind = "") {
  return absl::StrCat(kind.empty() ? "<p>" : absl::StrCat("<p class=\"", std::string(kind), "\">"),
                      std::string(html), "</p>\n");
}

std::string LinkTo(std::string_view scene) {
  return absl::StrCat("<a href=\"#", Text(scene), "\">", Text(scene), "</a>");
}

std::string Marked(Verdict verdict) {
  const char* kind = verdict == Verdict::kHolds   ? "holds\">\u2713 "
                     : verdict == Verdict::kFails ? "fails\">\u2717 "
                                                  : "unjudged\">\u2013 ";
  return absl::StrCat("<span class=\"", kind, VerdictText(verdict), "</span>");
}

std::string WithUnit(double value, const std::string& unit) {
  return absl::StrCat(Number(value), unit.empty() ? "" : " ", Text(unit));
}

std::string ClaimsOf(const FigureReport& report) {
  HtmlTable table{"", {"claim", "measured", "limit", "verdict"}, {false, true, true, false}, {}};
  for (const Claim& claim : report.claims) {
    table.rows.push_back({Text(claim.subject), WithUnit(claim.value, claim.unit),
                          Text(LimitText(claim)), Marked(claim.verdict)});
  }
  return ToHtml(table);
}

std::string Summary(const PaperReport& report) {
  const std::vector<ClaimSummary> summaries = Summarise(report);
  HtmlTable table{"Each claim over every scene that makes it; the number is the worst of them.",
                  {"claim", "worst", "limit", "in", "holds in", "verdict"},
                  {false, true, true, false, true, false},
                  {}};
  int judged = 0, held = 0;
  for (const ClaimSummary& summary : summaries) {
    judged += summary.judged;
    held += summary.held;
    table.rows.push_back(
        {Text(summary.worst.subject), WithUnit(summary.worst.value, summary.worst.unit),
         Text(LimitText(summary.worst)), LinkTo(summary.scene),
         absl::StrCat(summary.held, " of ", summary.judged), Marked(summary.worst.verdict)});
  }
  return absl::StrCat(
      Paragraph(absl::StrCat(
          "<strong>", held, " of ", judged, " claims hold</strong>; ",
          judged == held ? "none fails." : "those that do not are shown as they are.")),
      ToHtml(table));
}

std::string PaperTime(const PaperFigure& figure) {
  if (!figure.paper_ms) return "\u2013";
  return absl::StrCat(figure.paper_ms_is_bound ? "below " : "", Number(*figure.paper_ms));
}

std::string Times(const PaperReport& report) {
  HtmlTable table{
      "Milliseconds a step, of the second half of each run, one thread.",
      {"scene", "particles", "colliding", "median", "99th percentile", "budget", "paper"},
      {false, true, true, true, true, true, true},
      {}};
  for (const FigureReport& figure : report.figures) {
    if (!figure.not_run.empty()) continue;
    const PaperStudy& study = figure.study;
    const std::optional<double>& budget = figure.figure->budget_ms;
    table.rows.push_back(
        {LinkTo(figure.figure->scene), absl::StrCat(study.particles),
         absl::StrFormat("%.0f %%", 100 * study.second_half_colliding / study.particles),
         Number(study.cpu_ms_median), Number(study.cpu_ms_p99),
         budget ? absl::StrCat(Number(*budget),
                               study.cpu_ms_median <= *budget ? " (met)" : " (not met)")
                : "\u2013",
         PaperTime(*figure.figure)});
  }
  std::string html = absl::StrCat("<h2>Time</h2>\n", ToHtml(table));
  absl::StrAppend(
      &html, Paragraph("The paper's times are of detection and response only, on an Intel Xeon "
                       "5140 of 2006 (2.33 GHz, gcc 4.1, not optimised); ours are of the whole "
                       "step on the machine named above. Their ratio says nothing about the "
                       "methods. Budgets are the project's own bounds; they are met or not on an "
                       "idle machine, and are no claim of the paper.",
                       "soft"));
  const absl::StatusOr<std::string> plot = DrawPlot(CostPlot(report));
  absl::StrAppend(&html, "<div class=\"plots\"><figure><figcaption>",
                  "Time of a step against the number of particles</figcaption>",
                  plot.ok() ? *plot : Text(plot.status().ToString()), "</figure></div>\n");
  return html;
}

// The instants: pictures where there are any, with what is counted in them.
std::string Instants(const FigureReport& report) {
  const PaperStudy& study = report.study;
  std::string html = "<div class=\"strip\">";
  for (std::size_t i = 0; i < study.instants.size(); ++i) {
    const StudyInstant& instant = study.instants[i];
    const std::string caption = absl::StrFormat(
        "t = %.3g s: %d colliding particles, %.1f %%", instant.time_s, instant.colliding_particles,
        100.0 * instant.colliding_particles / study.particles);
    absl::StrAppend(&html, "<figure>");
    if (i < report.pictures.size()) {
      absl::StrAppend(&html, "<img alt=\"", Text(report.figure->title), ", ", caption, "\" src=\"",
                      PngAddress(report.pictures[i].png), "\">");
    }
    absl::StrAppend(&html, "<figcaption>", caption, "</figcaption></figure>\n");
  }
  absl::StrAppend(&html, "</div>\n");
  return html;
}

std::string Figure(const FigureReport& report) {
  const PaperFigure& figure = *report.figure;
  std::string html =
      absl::StrCat("<section id=\"", Text(figure.scene), "\"><h2>", Text(figure.figure),
                   figure.figure.empty() ? "" : ": ", Text(figure.title), "</h2>\n",
                   Paragraph(absl::StrCat("<strong>Claimed:</strong> ", Text(figure.paper_says))));
  if (!report.not_run.empty()) {
    return absl::StrCat(html,
                        Paragraph(absl::StrCat("<strong>Not run:</strong> ", Text(report.not_run))),
                        "</section>\n");
  }
  const PaperStudy& study = report.study;
  absl::StrAppend(
      &html,
      Paragraph(
          absl::StrCat("Scene ", Text(figure.scene), ": ", Text(report.description), " ",
                       study.bodies, " bodies, ", study.particles, " particles, ", study.triangles,
                       " triangles; ", Number(report.duration_s), " s in ", study.steps, " steps",
                       report.whole ? "."
                                    : absl::StrCat(" of ", Number(figure.duration_s),
                                                   " s (a quick run: what only the end can show is "
                                                   "not judged)."),
                       " Instants: ", Text(figure.instants_note), "."),
          "soft"),
      Instants(report), ClaimsOf(report), "<div class=\"plots\">\n");
  for (const Plot& plot : FigurePlots(report)) {
    const absl::StatusOr<std::string> svg = DrawPlot(plot);
    absl::StrAppend(&html, "<figure><figcaption>", Text(plot.title), "</figcaption>",
                    svg.ok() ? *svg : Text(svg.status().ToString()), "</figure>\n");
  }
  absl::StrAppend(&html, "</div></section>\n");
  return html;
}

}  // namespace

std::string PaperPage(const PaperReport& report) {
  const AboutMachine& machine = report.machine;
  std::string body = absl::StrCat(
      "<h1>The virtual adhesive, scene by scene</h1>\n",
      Paragraph("Every experiment of A. Carra, J.-L. Martiel, E. Promayon: <em>Virtual adhesive: "
                "a way to handle sticky collisions in surgical and biological simulators</em> "
                "(VRIPHYS 2007), run again and measured. Sizes, masses, stiffness and strengths "
                "are ours where the paper is silent; each scene file says so."),
      Paragraph(Text(absl::StrFormat(
                    "%s UTC; adhesim %s, commit %s; %s; %s, %d cores, load %.2f at the start",
                    machine.date, machine.version, machine.commit, machine.build, machine.processor,
                    machine.cores, machine.load)),
                "soft"));
  if (!report.no_pictures.empty()) {
    absl::StrAppend(
        &body, Paragraph(absl::StrCat("No pictures: ", Text(report.no_pictures), "."), "soft"));
  }
  absl::StrAppend(&body, Summary(report), Times(report));
  for (const FigureReport& figure : report.figures) absl::StrAppend(&body, Figure(figure));
  return HtmlPage("adhesim: the paper, scene by scene", body);
}

}  // namespace adhesim
