#include "clients/cli/paper_page.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <string_view>
#include <utility>

#include "clients/cli/about_machine.h"
#include "clients/cli/html_report.h"
#include "clients/cli/paper_plots.h"

namespace adhesim {
namespace {

// Every text goes through here on its way into the page.
std::string Text(std::string_view text) { return HtmlEscape(text); }

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
  return absl::StrCat(ShortNumber(value), unit.empty() ? "" : " ", Text(unit));
}

std::string TableOf(const std::vector<Claim>& claims) {
  HtmlTable table{"", {"claim", "measured", "limit", "verdict"}, {false, true, true, false}, {}};
  for (const Claim& claim : claims) {
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
      HtmlParagraph(absl::StrCat(
          "<strong>", held, " of ", judged, " claims hold</strong>; ",
          judged == held ? "none fails." : "those that do not are shown as they are.")),
      ToHtml(table));
}

std::string PaperTime(const PaperFigure& figure) {
  if (!figure.paper_ms) return "\u2013";
  return absl::StrCat(figure.paper_ms_is_bound ? "below " : "", ShortNumber(*figure.paper_ms));
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
         ShortNumber(study.cpu_ms_median), ShortNumber(study.cpu_ms_p99),
         budget ? absl::StrCat(ShortNumber(*budget),
                               study.cpu_ms_median <= *budget ? " (met)" : " (not met)")
                : "\u2013",
         PaperTime(*figure.figure)});
  }
  std::string html = absl::StrCat("<h2>Time</h2>\n", ToHtml(table));
  absl::StrAppend(
      &html,
      HtmlParagraph("The paper's times are of detection and response only, on an Intel Xeon "
                    "5140 of 2006 (2.33 GHz, gcc 4.1, not optimised); ours are of the whole "
                    "step on the machine named above. Their ratio says nothing about the "
                    "methods. Budgets are the project's own bounds; they are met or not on an "
                    "idle machine, and are no claim of the paper.",
                    "soft"));
  return html + DrawPlots({CostPlot(report)});
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

// Bodies that lie in each other at the start are pushed apart; what that brought is no claim.
std::string PushedApart(const PaperStudy& study) {
  const double pushed_j = study.samples.back().pushed_j;
  if (pushed_j == 0) return "";
  return HtmlParagraph(
      Text(absl::StrFormat(
          "Bodies lie in each other at the start. Pushing them apart brought %.3g J "
          "(%.3g %% of E_ref), which is booked as a correction and counts as put in.",
          pushed_j, 100 * pushed_j / study.reference_j)),
      "soft");
}

std::string Figure(const FigureReport& report) {
  const PaperFigure& figure = *report.figure;
  std::string html = absl::StrCat(
      "<section id=\"", Text(figure.scene), "\"><h2>", Text(figure.figure),
      figure.figure.empty() ? "" : ": ", Text(figure.title), "</h2>\n",
      HtmlParagraph(absl::StrCat("<strong>Claimed:</strong> ", Text(figure.paper_says))));
  if (!report.not_run.empty()) {
    return absl::StrCat(
        html, HtmlParagraph(absl::StrCat("<strong>Not run:</strong> ", Text(report.not_run))),
        "</section>\n");
  }
  const PaperStudy& study = report.study;
  absl::StrAppend(
      &html,
      HtmlParagraph(
          absl::StrCat("Scene ", Text(figure.scene), ": ", Text(report.description), " ",
                       study.bodies, " bodies, ", study.particles, " particles, ", study.triangles,
                       " triangles; ", ShortNumber(report.duration_s), " s in ", study.steps,
                       " steps",
                       report.whole ? "."
                                    : absl::StrCat(" of ", ShortNumber(figure.duration_s),
                                                   " s (a quick run: what only the end can show is "
                                                   "not judged)."),
                       " Instants: ", Text(figure.instants_note), "."),
          "soft"),
      PushedApart(study), Instants(report), TableOf(report.claims), DrawPlots(FigurePlots(report)),
      "</section>\n");
  return html;
}

// What the curves and the table show; numbers stand there.
std::string RivalsExplained() {
  std::string html;
  for (const std::string_view text : {
           "Two cells fall into a common well, meet off their axis, and are driven together and "
           "apart by it. There is neither drag nor damping: only contact can take energy or bring "
           "it. The files in scenes/paper/rivals differ in the method alone; each method reaches "
           "12 mm, and each that pulls holds a particle with 21.6 N at most. Energy is kinetic, "
           "elastic, and of the method's own springs; what was put in is the initial energy and "
           "the work of the well. Every method is run at several rates: what is the fault of the "
           "time step vanishes with it.",
           "The virtual adhesive adds none at any rate: capture takes energy, as an inelastic "
           "impact does, and keeps surfaces apart.",
           "Penalty forces add only what the step does, and it vanishes; but they never pull: the "
           "cells bounce off.",
           "Elastic links add energy whenever one is made, because it is made stretched. That "
           "does not vanish with the step. Unstretched links, made at their rest length, add "
           "only what the step does: it is the prestress that adds it, and not links as such.",
           "Attraction impulses add energy by the step, and it vanishes, because they have a "
           "potential. But they lend it: who watches the bodies alone, as a simulator does that "
           "books impulses as nothing, sees the bodies gain a large share at every rate while "
           "they are in the well of the impulses; parting costs it again.",
       }) {
    html += HtmlParagraph(Text(text));
  }
  return html;
}

std::string Rivals(const PaperReport& report) {
  HtmlTable table{
      "Most energy above what was put in, in % of E_ref, at each rate. At the lowest rate: the "
      "same of the bodies "
      "alone, the deepest overlap, the greatest distance of the centres after the cells were "
      "nearest, CPU time.",
      {"method"},
      {false},
      {}};
  const auto column = [&](std::string header, bool numeric) {
    table.headers.push_back(std::move(header));
    table.numeric.push_back(numeric);
  };
  for (const int rate_hz : RivalRatesHz()) column(absl::StrCat(rate_hz, " Hz"), true);
  column("bodies alone", true);
  column("depth, mm", true);
  column("pulls", false);
  column("apart, m", true);
  column("ms a step", true);
  column("sub-steps", true);
  const auto percent = [](double share) { return absl::StrFormat("%.3f", 100 * share); };
  for (const RivalResult& result : report.rivals) {
    const RivalRun& run = result.runs.front();
    std::vector<std::string> row = {Text(result.rival->name)};
    for (const RivalRun& at : result.runs) row.push_back(percent(EnergyExcess(at.study)));
    row.insert(
        row.end(),
        {percent(BodiesExcess(run.study)), absl::StrFormat("%.2f", 1e3 * GreatestDepth(run.study)),
         result.rival->pulls ? "yes" : "no", absl::StrFormat("%.2f", PartedTo(run.study)),
         ShortNumber(run.study.cpu_ms_median), absl::StrCat(run.substeps)});
    table.rows.push_back(std::move(row));
  }
  return absl::StrCat("<section id=\"", kRivals, "\"><h2>Compared with other methods</h2>\n",
                      RivalsExplained(), ToHtml(table), TableOf(report.rival_claims),
                      DrawPlots(RivalPlots(report.rivals)), "</section>\n");
}

}  // namespace

std::string PaperPage(const PaperReport& report) {
  std::string body = absl::StrCat(
      "<h1>The virtual adhesive, scene by scene</h1>\n",
      HtmlParagraph(
          "Every experiment of A. Carra, J.-L. Martiel, E. Promayon: <em>Virtual adhesive: "
          "a way to handle sticky collisions in surgical and biological simulators</em> "
          "(VRIPHYS 2007), run again and measured. Sizes, masses, stiffness and strengths "
          "are ours where the paper is silent; each scene file says so."),
      HtmlParagraph(Text(MachineText(report.machine)), "soft"));
  if (!report.no_pictures.empty()) {
    absl::StrAppend(
        &body, HtmlParagraph(absl::StrCat("No pictures: ", Text(report.no_pictures), "."), "soft"));
  }
  absl::StrAppend(&body, Summary(report), Times(report));
  for (const FigureReport& figure : report.figures) absl::StrAppend(&body, Figure(figure));
  if (!report.rivals.empty()) absl::StrAppend(&body, Rivals(report));
  return HtmlPage("adhesim: the paper, scene by scene", body);
}

}  // namespace adhesim
