#include "clients/cli/paper_plots.h"

#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace adhesim {
namespace {

constexpr char kTime[] = "simulated time, s";

// A curve of the samples for which `value` has one.
template <typename Value>
PlotSeries Curve(std::string name, const PaperStudy& study, const Value& value) {
  PlotSeries series;
  series.name = std::move(name);
  for (const StudySample& sample : study.samples) {
    const std::optional<double> y = value(sample);
    if (!y || !std::isfinite(*y)) continue;
    series.x.push_back(sample.time_s);
    series.y.push_back(*y);
  }
  return series;
}

Plot OverTime(std::string title, std::string y_label, bool from_zero = true) {
  Plot plot;
  plot.title = std::move(title);
  plot.x.label = kTime;
  plot.y.label = std::move(y_label);
  plot.y.from_zero = from_zero;
  return plot;
}

Plot ContactPlot(const PaperStudy& study) {
  Plot plot = OverTime("Colliding particles", "% of all particles");
  plot.series.push_back(Curve("colliding particles", study, [&](const StudySample& s) {
    return std::optional(100.0 * s.colliding_particles / study.particles);
  }));
  return plot;
}

Plot StepTimePlot(const FigureReport& report) {
  Plot plot = OverTime("CPU time of a step", "ms");
  plot.series.push_back(Curve("median between samples", report.study, [](const StudySample& s) {
    return s.time_s > 0 ? std::optional(s.cpu_ms) : std::nullopt;
  }));
  if (report.figure->budget_ms) plot.lines.push_back({"budget", *report.figure->budget_ms});
  return plot;
}

Plot OverlapPlot(const PaperStudy& study) {
  Plot plot = OverTime("Overlap and gap", "mm");
  plot.series.push_back(Curve("deepest overlap", study, [](const StudySample& s) {
    return s.max_depth_m ? std::optional(1e3 * *s.max_depth_m) : std::nullopt;
  }));
  PlotSeries gap = Curve("mean gap of pairs that hold", study, [](const StudySample& s) {
    return s.mean_gap_m ? std::optional(1e3 * *s.mean_gap_m) : std::nullopt;
  });
  gap.dashed = true;
  plot.series.push_back(std::move(gap));
  if (study.capture_distance_m) {
    plot.lines.push_back({"capture distance", 1e3 * *study.capture_distance_m});
  }
  return plot;
}

Plot EnergyPlot(const PaperStudy& study) {
  Plot plot = OverTime("Energy", "J", false);
  plot.series.push_back(Curve("kinetic + elastic", study,
                              [](const StudySample& s) { return std::optional(s.energy_j); }));
  PlotSeries permitted = Curve("initial + work of fields and tools", study,
                               [](const StudySample& s) { return std::optional(s.permitted_j); });
  permitted.dashed = true;
  plot.series.push_back(std::move(permitted));
  plot.series.push_back(Curve("lost to capture", study,
                              [](const StudySample& s) { return std::optional(s.captured_j); }));
  plot.series.push_back(Curve("lost to drag and damping", study,
                              [](const StudySample& s) { return std::optional(s.viscous_j); }));
  return plot;
}

}  // namespace

std::vector<Plot> FigurePlots(const FigureReport& report) {
  const PaperStudy& study = report.study;
  std::vector<Plot> plots = {ContactPlot(study), StepTimePlot(report), OverlapPlot(study),
                             EnergyPlot(study)};
  switch (report.figure->story) {
    case Story::kNone:
      break;
    case Story::kEndsTogether:
    case Story::kEndsApart: {
      Plot plot = OverTime("Distance between the bodies' centres", "m");
      plot.series.push_back(
          Curve("distance", study, [](const StudySample& s) { return s.separation_m; }));
      plots.push_back(std::move(plot));
      break;
    }
    case Story::kAggregates: {
      Plot plot = OverTime("Radius of the aggregate", "m");
      plot.series.push_back(Curve("radius of gyration", study,
                                  [](const StudySample& s) { return std::optional(s.radius_m); }));
      plots.push_back(std::move(plot));
      plot = OverTime("Bodies in the largest group", "bodies");
      plot.series.push_back(Curve("bodies that hold each other", study, [](const StudySample& s) {
        return std::optional<double>(s.group_bodies);
      }));
      plots.push_back(std::move(plot));
      break;
    }
    case Story::kRolls: {
      Plot plot = OverTime("Rolling", "m");
      plot.series.push_back(
          Curve("way of the centre", study, [](const StudySample& s) { return s.travel_m; }));
      plot.series.push_back(
          Curve("rolled arc", study, [](const StudySample& s) { return s.rolled_m; }));
      plot.series.back().dashed = true;
      plots.push_back(std::move(plot));
      break;
    }
  }
  return plots;
}

Plot CostPlot(const PaperReport& report) {
  Plot plot;
  plot.title = "Time of a step against the number of particles";
  plot.x = {"particles", PlotScale::kLog};
  plot.y = {"ms", PlotScale::kLog};
  PlotSeries ours, paper;
  ours.name = "adhesim, whole step";
  paper.name = "paper, detection and response, 2006";
  ours.markers = paper.markers = true;
  for (const FigureReport& figure : report.figures) {
    if (!figure.not_run.empty() || figure.study.particles == 0) continue;
    const auto add = [&](double ms, PlotSeries* series) {
      if (!(ms > 0)) return;
      series->x.push_back(figure.study.particles);
      series->y.push_back(ms);
      series->point_names.emplace_back(figure.figure->scene);
    };
    add(figure.study.cpu_ms_median, &ours);
    add(figure.figure->paper_ms.value_or(0), &paper);
  }
  plot.series = {std::move(ours), std::move(paper)};
  return plot;
}

}  // namespace adhesim
