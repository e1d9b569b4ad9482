#include "clients/cli/accuracy_page.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "clients/cli/html_report.h"
#include "clients/cli/svg_plot.h"

namespace adhesim {
namespace {

std::string Text(std::string_view text) { return HtmlEscape(text); }

// In a cell that is not to be squeezed.
std::string Wide(const std::string& html) { return "<span class=\"wide\">" + html + "</span>"; }

std::string Number(double value) { return absl::StrFormat("%.3g", value); }

// What a diagram takes of an error; nothing: that error has none, or it is 0.
using Measure = std::function<std::optional<double>(const AccuracyError&)>;

std::optional<double> Above0(double value) {
  return value > 0 && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

// A series of settings, without any yet: circles, and diamonds of another engine.
PlotSeries Points(const AccuracyPoint& first, const std::string& name) {
  PlotSeries series;
  series.name = name;
  series.markers = true;
  series.diamonds = first.setting.kind == DialKind::kRival;
  return series;
}

// Error on x, cost on y, both logarithmic, as the field draws them.
Plot WorkPrecision(const AccuracyStudy& study, const std::string& title, const std::string& x_label,
                   const Measure& measure) {
  Plot plot;
  plot.title = title;
  plot.x = {x_label, PlotScale::kLog};
  plot.y = {"wall time per simulated time", PlotScale::kLog};
  for (const AccuracyPoint& point : study.points) {
    if (!IsJudgedByReference(point.setting) || !point.error) continue;
    const std::optional<double> x = measure(*point.error);
    if (!x || !Above0(point.cost.wall_min)) continue;
    const auto same = [&](const PlotSeries& series) { return series.name == point.dial; };
    auto series = std::find_if(plot.series.begin(), plot.series.end(), same);
    if (series == plot.series.end()) {
      series = plot.series.insert(series, Points(point, point.dial));
    }
    series->x.push_back(*x);
    series->y.push_back(point.cost.wall_min);
    series->point_names.push_back(point.setting.name);
  }
  const std::optional<double> second = study.band ? measure(*study.band) : std::nullopt;
  if (second) {
    plot.bands.push_back({"difference of the two references", true, *second});
    if (Above0(study.second->wall)) {
      PlotSeries one;
      one.name = "second reference";
      one.x = {*second};
      one.y = {study.second->wall};
      one.markers = true;
      one.point_names = {study.second->name};
      plot.series.push_back(std::move(one));
    }
  }
  plot.lines = {{"real time", 1}, {"step budget", study.limits.step_share}};
  return plot;
}

// Error against the step, with the line of the fitted order.
Plot ErrorOverStep(const AccuracyStudy& study, const std::string& title, const std::string& label,
                   const Measure& measure, bool fitted) {
  Plot plot;
  plot.title = title;
  plot.x = {"dt, ms", PlotScale::kLog};
  plot.y = {label, PlotScale::kLog};
  std::vector<PlotSeries> lines;
  for (const AccuracyPoint& point : study.points) {
    const std::optional<double> y = point.error ? measure(*point.error) : std::nullopt;
    if (!IsJudgedByReference(point.setting) || !y) continue;
    const std::string& method = point.setting.method;
    const auto same = [&](const PlotSeries& series) { return series.name == method; };
    auto series = std::find_if(plot.series.begin(), plot.series.end(), same);
    if (series == plot.series.end()) {
      series = plot.series.insert(series, Points(point, method));
    }
    series->x.push_back(1e3 / point.setting.rate_hz);
    series->y.push_back(*y);
    series->point_names.push_back(point.setting.name);
  }
  // One step alone shows nothing here.
  std::erase_if(plot.series, [](const PlotSeries& series) { return series.x.size() < 2; });
  for (std::size_t i = 0; fitted && i < plot.series.size(); ++i) {
    for (const AccuracyOrder& order : study.orders) {
      if (order.method != plot.series[i].name) continue;
      const auto [least, most] =
          std::minmax_element(plot.series[i].x.begin(), plot.series[i].x.end());
      PlotSeries line;
      line.name = absl::StrFormat("order %.2f", order.fit.order);
      line.x = {*least, *most};
      line.dashed = true;
      line.colour = static_cast<int>(i);
      for (const double dt_ms : line.x) {
        line.y.push_back(1e3 * order.fit.factor * std::pow(1e-3 * dt_ms, order.fit.order));
      }
      lines.push_back(std::move(line));
    }
  }
  plot.series.insert(plot.series.end(), lines.begin(), lines.end());
  const std::optional<double> band = study.band ? measure(*study.band) : std::nullopt;
  if (band) plot.bands.push_back({"difference of the two references", false, *band});
  return plot;
}

std::optional<double> PositionMm(const AccuracyError& error) {
  return Above0(1e3 * error.position_m.l2);
}
std::optional<double> WorstPercent(const AccuracyError& error) {
  return Above0(100 * error.worst_share);
}

// Cost against what the scene is judged by.
Plot FirstDiagram(const AccuracyStudy& study) {
  return study.chaotic ? WorkPrecision(study, "Cost against the error of the observables",
                                       "worst of the observables, %", WorstPercent)
                       : WorkPrecision(study, "Cost against the error of positions",
                                       "root mean square of position errors, mm", PositionMm);
}

std::string Diagrams(const AccuracyStudy& study) {
  const Measure force = [](const AccuracyError& e) {
    return e.force_n ? Above0(e.force_n->l2) : std::nullopt;
  };
  std::vector<Plot> plots = {FirstDiagram(study)};
  if (study.chaotic) {
    plots.push_back(ErrorOverStep(study, "Error of the observables against the step",
                                  "worst of the observables, %", WorstPercent, false));
  } else {
    plots.push_back(ErrorOverStep(study, "Error of positions against the step",
                                  "position error, mm", PositionMm, true));
  }
  if (study.peak_force_n > 0) {
    plots.push_back(WorkPrecision(study, "Cost against the error of tools' forces",
                                  "root mean square of force errors, N", force));
    plots.push_back(
        ErrorOverStep(study, "Error of forces against the step", "force error, N", force, false));
  }
  return DrawPlots(plots);
}

std::string EventsText(const AccuracyError& error) {
  if (error.events.empty()) return "\u2013";
  std::string text = Number(1e3 * error.worst_event_s);
  if (error.lost_events > 0) absl::StrAppend(&text, ", ", error.lost_events, " not in both");
  return text;
}

// The columns of errors.
std::vector<std::string> ErrorCells(const AccuracyError& error, bool forces) {
  std::vector<std::string> cells = {Number(1e3 * error.position_m.l2),
                                    Number(1e3 * error.position_m.linf),
                                    Number(1e3 * error.position_m.final)};
  if (forces) {
    cells.push_back(error.force_n ? Number(error.force_n->l2) : "\u2013");
    cells.push_back(error.force_n ? Number(error.force_n->linf) : "\u2013");
  }
  cells.push_back(EventsText(error));
  cells.push_back(absl::StrFormat("%.2g", 100 * error.worst_share));
  return cells;
}

std::string TableOf(const AccuracyStudy& study, DialKind kind, const std::string& caption) {
  const bool forces = study.peak_force_n > 0;
  HtmlTable table{caption, {"dial: setting", "mm, rms", "mm, largest", "mm, end"}, {}, {}};
  if (forces) table.headers.insert(table.headers.end(), {"N, rms", "N, largest"});
  table.headers.insert(table.headers.end(),
                       {"events, ms", "observables, %", "s per s, least", "median",
                        "99th percentile", "step p99, ms", "remarks"});
  if (study.formula) table.headers.push_back("end deflects, mm");
  table.numeric.assign(table.headers.size(), true);
  table.numeric[0] = false;
  const std::size_t remarks = table.headers.size() - (study.formula ? 2 : 1);
  table.numeric[remarks] = false;
  for (std::size_t i = 0; i < study.points.size(); ++i) {
    const AccuracyPoint& point = study.points[i];
    if (point.setting.kind != kind) continue;
    std::vector<std::string> row = {Wide(Text(absl::StrCat(point.dial, ": ", point.setting.name)))};
    if (point.error) {
      for (std::string& cell : ErrorCells(*point.error, forces)) row.push_back(std::move(cell));
    }
    row.resize(remarks - 4, "\u2013");
    const CostFigures& cost = point.cost;
    for (const double value : {cost.wall_min, cost.wall_p50, cost.wall_p99, cost.step_p99_ms}) {
      row.push_back(cost.repeats > 0 ? Number(value) : "\u2013");
    }
    if (!point.failed.empty()) {
      row.push_back(Wide("<span class=\"fails\">failed</span> " + Text(point.failed)));
    } else if (point.not_run) {
      row.push_back("no time left");
    } else {
      row.push_back(Text(BitsText(point.bits)));
    }
    if (study.formula)
      row.push_back(point.deflection_m ? Number(1e3 * *point.deflection_m) : "\u2013");
    table.rows.push_back(std::move(row));
  }
  return table.rows.empty() ? "" : ToHtml(table);
}

std::string Recommendation(const AccuracyStudy& study) {
  std::string html = "<h2>Recommendation</h2>\n";
  for (const std::string& line : AdviceText(study)) html += HtmlParagraph(Text(line));
  html += HtmlParagraph(
      "Only what solves the scene's own equations on its own mesh is recommended. Errors are root "
      "mean squares over the instants; a tool's force is its mean since the instant before.",
      "soft");
  return html;
}

std::string References(const AccuracyStudy& study) {
  std::string html = absl::StrCat("<h2>What is taken as true</h2>\n",
                                  HtmlParagraph(absl::StrCat("<strong>Reference:</strong> ",
                                                             Text(study.reference.name), ". ")));
  if (study.second) {
    absl::StrAppend(
        &html,
        HtmlParagraph(absl::StrCat("<strong>Second reference:</strong> ", Text(study.second->name),
                                   ". They share ", Text(study.references_share), ".")),
        HtmlParagraph(Text(absl::StrFormat(
            "They differ by %.3g mm, %.3g %% of the motion (%.4g mm): the grey band.%s",
            1e3 * study.band->position_m.l2, 100 * study.band->position_m.l2 / study.motion_m,
            1e3 * study.motion_m,
            study.chaotic
                ? " That is more than 10 %: either nobody can foresee where each particle goes, or "
                  "the second reference's steps are still too long. Settings are judged "
                  "by observables, unless a tolerance was asked for."
                : ""))));
    HtmlTable table{"Observables of both references.",
                    {"observable", "reference", "second", "difference, %"},
                    {false, true, true, true},
                    {}};
    for (const Observable& observable : study.band->observables) {
      table.rows.push_back(
          {Text(observable.name + (observable.unit.empty() ? "" : ", ") + observable.unit),
           Number(observable.reference), Number(observable.value),
           absl::StrFormat("%.2g", 100 * observable.share)});
    }
    if (!table.rows.empty()) html += ToHtml(table);
  } else {
    html += HtmlParagraph("There is no second one: how far the reference is off is not known.");
  }
  if (study.formula) {
    html += HtmlParagraph(Text(absl::StrFormat(
        "The end is known in closed form. %s: %.4g mm. The reference on this mesh deflects by "
        "%.4g mm (%+.2f %%): that is the mesh's share.",
        study.formula->text, 1e3 * study.formula->deflection_m, 1e3 * study.reference_deflection_m,
        100 * (study.reference_deflection_m / study.formula->deflection_m - 1))));
  }
  return html;
}

// Another engine's runs, or nothing: why it has none is told with the dials.
std::string Rival(const AccuracyStudy& study) {
  if (study.rival_about.empty()) return "";
  return absl::StrCat(TableOf(study, DialKind::kRival,
                              "Another engine on the same mesh, against the same reference, "
                              "interleaved with ours and timed the same way."),
                      HtmlParagraph(Text(study.rival_about) + ".", "soft"));
}

std::string Beside(const AccuracyStudy& study) {
  std::string html = "<h2>Mesh, law and zones</h2>\n";
  if (study.finer_mesh) {
    html += HtmlParagraph(Text(absl::StrFormat(
        "The scene's own mesh differs from one twice as fine by %.3g mm. Other levels, against "
        "the same:",
        1e3 * study.own_mesh->position_m.l2)));
  }
  html += TableOf(study, DialKind::kMesh, "Levels of the mesh, against a mesh twice as fine.");
  html += TableOf(study, DialKind::kModel,
                  "Other equations: no errors, but differences from the scene as it is.");
  for (const AccuracyDial& dial : study.dials) {
    if (dial.not_offered.empty()) continue;
    html += HtmlParagraph(Text(absl::StrCat(dial.name, ": ", dial.not_offered, ".")), "soft");
  }
  return html;
}

}  // namespace

std::string AccuracyPage(const AccuracyReport& report) {
  const AccuracyStudy& study = report.study;
  std::string body = absl::StrCat(
      "<h1>", Text(study.scene), ": what accuracy costs</h1>\n",
      HtmlParagraph(Text(report.description)),
      HtmlParagraph(
          Text(absl::StrFormat(
              "bodies: %d; %d particles, %d tetrahedra; %.4g s, watched at %d instants at "
              "%d points of the surface.",
              study.bodies, study.particles, study.tetrahedra, study.duration_s,
              static_cast<int>(study.instants), study.probes)),
          "soft"),
      HtmlParagraph(Text(MachineText(report.machine)), "soft"), Recommendation(study),
      Diagrams(study));
  absl::StrAppend(&body, References(study), "<h2>Every setting</h2>\n",
                  TableOf(study, DialKind::kNumerical,
                          "Errors against the reference; cost is wall time per simulated second, "
                          "one run after another, interleaved."),
                  Rival(study), Beside(study));
  if (!study.left_out.empty()) {
    absl::StrAppend(&body, "<h2>Left out</h2>\n<ul>");
    for (const std::string& text : study.left_out)
      absl::StrAppend(&body, "<li>", Text(text), "</li>");
    absl::StrAppend(&body, "</ul>\n");
  }
  return HtmlPage("adhesim: accuracy against cost, " + study.scene, body);
}

absl::StatusOr<std::string> AccuracyPicture(const AccuracyReport& report) {
  Plot plot = FirstDiagram(report.study);
  plot.title = absl::StrCat(report.study.scene, ": ", plot.title);
  return DrawPicture(plot);
}

}  // namespace adhesim
