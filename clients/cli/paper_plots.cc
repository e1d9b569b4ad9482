#include "clients/cli/paper_plots.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cmath>
#include <optional>
#include <string>
#include <string_view>
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
  // Only scenes with sliding contacts have it.
  if (study.samples.back().slid_j > 0) {
    plot.series.push_back(Curve("lost to sliding", study,
                                [](const StudySample& s) { return std::optional(s.slid_j); }));
  }
  return plot;
}

// A curve of each method, of its lowest or highest rate; `value` has the sample and E_ref.
template <typename Value>
Plot RivalPlot(Plot plot, const std::vector<RivalResult>& results, bool highest_rate,
               const Value& value) {
  for (const RivalResult& result : results) {
    if (result.runs.empty()) continue;
    const RivalRun& run = highest_rate ? result.runs.back() : result.runs.front();
    plot.series.push_back(
        Curve(std::string(result.rival->name), run.study,
              [&](const StudySample& sample) { return value(sample, run.study.reference_j); }));
  }
  return plot;
}

std::string AtRate(std::string_view title, int rate_hz) {
  return absl::StrFormat("%s, %d Hz", title, rate_hz);
}

}  // namespace

std::vector<Plot> RivalPlots(const std::vector<RivalResult>& results) {
  const int low_hz = RivalRatesHz().front(), high_hz = RivalRatesHz().back();
  const auto whole = [](const StudySample& s, double reference_j) -> std::optional<double> {
    if (!(reference_j > 0)) return std::nullopt;
    return 100 * (s.energy_j - s.permitted_j) / reference_j;
  };
  const auto bodies = [](const StudySample& s, double reference_j) -> std::optional<double> {
    if (!(reference_j > 0)) return std::nullopt;
    return 100 * (s.bodies_energy_j.value_or(s.energy_j) - s.permitted_j) / reference_j;
  };
  const auto depth = [](const StudySample& s, double) -> std::optional<double> {
    return s.max_depth_m ? std::optional(1e3 * *s.max_depth_m) : std::nullopt;
  };
  const auto apart = [](const StudySample& s, double) { return s.separation_m; };
  const auto energy = [](std::string title, int rate_hz) {
    Plot plot = OverTime(AtRate(title, rate_hz), "% of E_ref", false);
    plot.lines.push_back({"what was put in", 0});
    return plot;
  };
  return {
      RivalPlot(energy("Energy less what was put in", low_hz), results, false, whole),
      RivalPlot(energy("Energy less what was put in", high_hz), results, true, whole),
      RivalPlot(energy("The same of the bodies alone", low_hz), results, false, bodies),
      RivalPlot(OverTime(AtRate("Deepest overlap", low_hz), "mm"), results, false, depth),
      RivalPlot(OverTime(AtRate("Distance of the cells' centres", low_hz), "m", false), results,
                false, apart),
  };
}

std::vector<Plot> FigurePlots(const FigureReport& report) {
  const PaperStudy& study = report.study;
  std::vector<Plot> plots = {ContactPlot(study), StepTimePlot(report), OverlapPlot(study),
                             EnergyPlot(study)};
  switch (report.figure->story) {
    case Story::kNone:
    case Story::kHoldsAll:
    case Story::kOneZone:
      break;
    case Story::kPulls:
    case Story::kHangs: {
      Plot plot = OverTime(absl::StrCat("Way of ", std::string(report.figure->followed)), "m");
      plot.series.push_back(Curve("distance from where it started", study,
                                  [](const StudySample& s) { return s.moved_m; }));
      plots.push_back(std::move(plot));
      break;
    }
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
