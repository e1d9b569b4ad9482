#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

namespace adhesim {

enum class PlotScale { kLinear, kLog };

struct PlotAxis {
  std::string label;  // with its unit
  PlotScale scale = PlotScale::kLinear;
  bool from_zero = false;  // the axis begins at 0 where no value is below; linear only
};

struct PlotSeries {
  std::string name;
  std::vector<double> x, y;  // as long as each other
  bool dashed = false;
  bool markers = false;                  // points without a line
  bool diamonds = false;                 // of markers: others than circles
  std::vector<std::string> point_names;  // of markers; empty or as long as x
  int colour = -1;                       // of the page's; -1: by its place among the series
};

// A horizontal line across the plot: a limit.
struct PlotLine {
  std::string name;
  double y = 0;
};

// Grey, from the lower end of an axis up to a value: what is there cannot be told apart.
struct PlotBand {
  std::string name;
  bool on_x = true;  // false: on the y axis
  double to = 0;
};

struct Plot {
  std::string title;  // what it shows, for who cannot see it too
  PlotAxis x, y;
  std::vector<PlotSeries> series;
  std::vector<PlotLine> lines;
  std::vector<PlotBand> bands;
};

// A plot as an <svg> element for the pages of html_report.h, whose style sheet colours it: axes
// with round ticks, a legend, a title. Series without points appear in the legend alone. Errors:
// InvalidArgument, naming the series, for a value that is not finite or not above 0 on a
// logarithmic axis, and for lengths that differ.
absl::StatusOr<std::string> DrawPlot(const Plot& plot);

// The same as a file of its own, with its title and its colours, on its own ground: readable on a
// white page and on a dark one.
absl::StatusOr<std::string> DrawPicture(const Plot& plot);

// Plots beside each other, each with its title; what cannot be drawn says why.
std::string DrawPlots(const std::vector<Plot>& plots);

}  // namespace adhesim
