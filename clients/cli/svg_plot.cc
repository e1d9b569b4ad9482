#include "clients/cli/svg_plot.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "clients/cli/html_report.h"

namespace adhesim {
namespace {

// Pixels of the view box; the page scales it.
constexpr double kWidth = 520, kPlotHeight = 230;
constexpr double kLeft = 66, kRight = 24, kTop = 8, kBottom = 44, kLegendRow = 18;
constexpr double kTitleHeight = 34;  // of pictures
constexpr double kCharacter = 7;     // mean width of a letter, for the legend's rows
constexpr int kColours = 8;
constexpr int kTicks = 5;
// Labels and coordinates never show more than doubles of such sizes need.
constexpr double kLargest = 1e100, kSmallest = 1e-100;

// A value range and where it lies on the page.
struct Axis {
  PlotScale scale;
  double min, max;        // of values (their decimal logarithms where logarithmic), min < max
  double from_px, to_px;  // of min and max

  double Value(double v) const { return scale == PlotScale::kLog ? std::log10(v) : v; }
  double Pixel(double v) const {
    return from_px + (Value(v) - min) / (max - min) * (to_px - from_px);
  }
};

absl::Status CheckValue(double v, PlotScale scale, const std::string& name) {
  if (std::abs(v) <= kLargest && (scale == PlotScale::kLinear || v > 0)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "'", name, "' has the value ", v, ", which is not permitted on a ",
      scale == PlotScale::kLog ? "logarithmic axis (above 0, finite)" : "linear axis (finite)"));
}

absl::Status Check(const Plot& plot) {
  for (const PlotSeries& series : plot.series) {
    if (series.x.size() != series.y.size() ||
        (!series.point_names.empty() && series.point_names.size() != series.x.size())) {
      return absl::InvalidArgumentError(absl::StrCat("'", series.name, "' has ", series.x.size(),
                                                     " x, ", series.y.size(), " y and ",
                                                     series.point_names.size(), " names"));
    }
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      for (const auto& [value, scale] :
           {std::pair(series.x[i], plot.x.scale), std::pair(series.y[i], plot.y.scale)}) {
        if (const absl::Status status = CheckValue(value, scale, series.name); !status.ok()) {
          return status;
        }
      }
    }
  }
  for (const PlotLine& line : plot.lines) {
    if (const absl::Status status = CheckValue(line.y, plot.y.scale, line.name); !status.ok()) {
      return status;
    }
  }
  for (const PlotBand& band : plot.bands) {
    const PlotScale scale = band.on_x ? plot.x.scale : plot.y.scale;
    if (const absl::Status status = CheckValue(band.to, scale, band.name); !status.ok()) {
      return status;
    }
  }
  return absl::OkStatus();
}

// The largest of 1, 2, 5 times a power of ten that divides `span` into at least kTicks parts.
double TickStep(double span) {
  const double power = std::pow(10.0, std::floor(std::log10(span / kTicks)));
  for (const double factor : {5.0, 2.0}) {
    if (span / (factor * power) >= kTicks) return factor * power;
  }
  return power;
}

// The range of the values, widened to whole decades, or to ticks where it is linear.
Axis MakeAxis(const PlotAxis& of, const std::vector<double>& values, double from_px, double to_px) {
  Axis axis{of.scale, 0, 1, from_px, to_px};
  if (!values.empty()) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    axis.min = axis.Value(*low);
    axis.max = axis.Value(*high);
  }
  if (of.scale == PlotScale::kLog) {
    axis.min = std::floor(axis.min);
    axis.max = std::max(std::ceil(axis.max), axis.min + 1);
    return axis;
  }
  if (of.from_zero && axis.min > 0) axis.min = 0;
  // One value, or several that labels cannot tell apart: some room around it.
  const double size = std::max(std::abs(axis.min), std::abs(axis.max));
  if (axis.max - axis.min <= 1e-9 * size || size < kSmallest) {
    const double room = size < kSmallest ? 1 : size;
    if (!(of.from_zero && axis.min >= 0)) axis.min -= room;
    axis.max += room;
  }
  const double step = TickStep(axis.max - axis.min);
  axis.min = step * std::floor(axis.min / step + 1e-9);
  axis.max = step * std::ceil(axis.max / step - 1e-9);
  return axis;
}

// Values that get a line and a label.
std::vector<double> Ticks(const Axis& axis) {
  std::vector<double> ticks;
  if (axis.scale == PlotScale::kLog) {
    const double step = std::ceil((axis.max - axis.min) / 8);  // labels of 8 decades fit
    for (double decade = axis.min; decade <= axis.max; decade += step) {
      ticks.push_back(std::pow(10.0, decade));
    }
    return ticks;
  }
  const double step = TickStep(axis.max - axis.min);
  const auto first = static_cast<std::int64_t>(std::ceil(axis.min / step - 1e-9));
  const auto last = static_cast<std::int64_t>(std::floor(axis.max / step + 1e-9));
  for (std::int64_t i = first; i <= last; ++i) ticks.push_back(static_cast<double>(i) * step);
  return ticks;
}

std::string TickText(double v) { return absl::StrFormat("%.6g", v); }

std::string Pixel(double v) { return absl::StrFormat("%.1f", v); }

std::string DrawAxes(const Plot& plot, const Axis& x, const Axis& y) {
  std::string svg;
  for (const double v : Ticks(y)) {
    const std::string at = Pixel(y.Pixel(v));
    absl::StrAppend(&svg, "<line class=\"grid\" x1=\"", Pixel(x.from_px), "\" x2=\"",
                    Pixel(x.to_px), "\" y1=\"", at, "\" y2=\"", at, "\"/><text class=\"tick\" x=\"",
                    Pixel(x.from_px - 6), "\" y=\"", Pixel(y.Pixel(v) + 4),
                    "\" text-anchor=\"end\">", TickText(v), "</text>\n");
  }
  for (const double v : Ticks(x)) {
    const std::string at = Pixel(x.Pixel(v));
    absl::StrAppend(&svg, "<line class=\"grid\" x1=\"", at, "\" x2=\"", at, "\" y1=\"",
                    Pixel(y.from_px), "\" y2=\"", Pixel(y.to_px), "\"/><text class=\"tick\" x=\"",
                    at, "\" y=\"", Pixel(y.from_px + 16), "\" text-anchor=\"middle\">", TickText(v),
                    "</text>\n");
  }
  const double middle = 0.5 * (y.from_px + y.to_px);
  absl::StrAppend(&svg, "<polyline class=\"axis\" points=\"", Pixel(x.from_px), ",", Pixel(y.to_px),
                  " ", Pixel(x.from_px), ",", Pixel(y.from_px), " ", Pixel(x.to_px), ",",
                  Pixel(y.from_px), "\"/>\n<text x=\"", Pixel(0.5 * (x.from_px + x.to_px)),
                  "\" y=\"", Pixel(y.from_px + 36), "\" text-anchor=\"middle\">",
                  HtmlEscape(plot.x.label),
                  "</text>\n<text text-anchor=\"middle\" transform=\"translate(14 ", Pixel(middle),
                  ") rotate(-90)\">", HtmlEscape(plot.y.label), "</text>\n");
  return svg;
}

std::string Colour(const PlotSeries& series, std::size_t index) {
  return absl::StrCat("s", (series.colour < 0 ? index : series.colour) % kColours);
}

// A point of a series, without its end, so that it may have a title.
std::string DrawMarker(const PlotSeries& series, const std::string& colour, double px, double py) {
  if (!series.diamonds) {
    return absl::StrCat("<circle class=\"dot ", colour, "\" r=\"4\" cx=\"", Pixel(px), "\" cy=\"",
                        Pixel(py), "\"");
  }
  return absl::StrCat("<path class=\"dot ", colour, "\" d=\"M", Pixel(px), " ", Pixel(py - 5.5),
                      "l5.5 5.5l-5.5 5.5l-5.5 -5.5z\"");
}

std::string DrawSeries(const PlotSeries& series, std::size_t index, const Axis& x, const Axis& y) {
  const std::string colour = Colour(series, index);
  std::string svg = absl::StrCat("<g><title>", HtmlEscape(series.name), "</title>");
  if (series.markers) {
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      const double px = x.Pixel(series.x[i]), py = y.Pixel(series.y[i]);
      absl::StrAppend(&svg, DrawMarker(series, colour, px, py), ">");
      const std::string name = series.point_names.empty() ? "" : series.point_names[i];
      absl::StrAppend(&svg, "<title>",
                      HtmlEscape(absl::StrFormat("%s %s: %.4g, %.4g", series.name, name,
                                                 series.x[i], series.y[i])),
                      series.diamonds ? "</title></path>\n" : "</title></circle>\n");
    }
  } else if (!series.x.empty()) {
    absl::StrAppend(&svg, "<polyline class=\"curve ", colour, series.dashed ? " dashed" : "",
                    "\" points=\"");
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      absl::StrAppend(&svg, i == 0 ? "" : " ", Pixel(x.Pixel(series.x[i])), ",",
                      Pixel(y.Pixel(series.y[i])));
    }
    absl::StrAppend(&svg, "\"/>");
  }
  absl::StrAppend(&svg, "</g>\n");
  return svg;
}

// One entry of the legend, and how it is drawn.
struct Entry {
  std::string name, line_class;
  const PlotSeries* markers = nullptr;  // drawn as its points are
  std::string colour;
};

// Entries in rows from `top_px` on; sets the rows' number.
std::string DrawLegend(const std::vector<Entry>& entries, double top_px, int* rows) {
  std::string svg;
  double at = kLeft;
  *rows = entries.empty() ? 0 : 1;
  for (const Entry& entry : entries) {
    const double width = 34 + kCharacter * static_cast<double>(entry.name.size());
    if (at > kLeft && at + width > kWidth - kRight) {
      at = kLeft;
      ++*rows;
    }
    const double y = top_px + kLegendRow * (*rows - 0.5);
    const std::string sign =
        entry.markers != nullptr
            ? DrawMarker(*entry.markers, entry.colour, at + 10, y)
            : absl::StrCat("<line class=\"", entry.line_class, "\" x1=\"", Pixel(at), "\" x2=\"",
                           Pixel(at + 20), "\" y1=\"", Pixel(y), "\" y2=\"", Pixel(y), "\"");
    absl::StrAppend(&svg, sign, "/><text x=\"", Pixel(at + 25), "\" y=\"", Pixel(y + 4), "\">",
                    HtmlEscape(entry.name), "</text>\n");
    at += width;
  }
  return svg;
}

std::vector<Entry> LegendOf(const Plot& plot) {
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const PlotSeries& series = plot.series[i];
    entries.push_back({series.x.empty() ? absl::StrCat(series.name, " (none)") : series.name,
                       absl::StrCat("curve ", Colour(series, i), series.dashed ? " dashed" : ""),
                       series.markers ? &series : nullptr, Colour(series, i)});
  }
  for (const PlotLine& line : plot.lines) entries.push_back({line.name, "limit", nullptr, ""});
  for (const PlotBand& band : plot.bands) entries.push_back({band.name, "grey", nullptr, ""});
  return entries;
}

std::string DrawBand(const PlotBand& band, const Axis& x, const Axis& y) {
  const double right = band.on_x ? x.Pixel(band.to) : x.to_px;
  const double top = band.on_x ? y.to_px : y.Pixel(band.to);
  return absl::StrCat("<rect class=\"band\" x=\"", Pixel(x.from_px), "\" y=\"", Pixel(top),
                      "\" width=\"", Pixel(right - x.from_px), "\" height=\"",
                      Pixel(y.from_px - top), "\"><title>", HtmlEscape(band.name),
                      "</title></rect>\n");
}

// What is within the element, and how high it is.
absl::StatusOr<std::string> DrawInside(const Plot& plot, double* height) {
  if (const absl::Status status = Check(plot); !status.ok()) return status;
  std::vector<double> xs, ys;
  for (const PlotSeries& series : plot.series) {
    xs.insert(xs.end(), series.x.begin(), series.x.end());
    ys.insert(ys.end(), series.y.begin(), series.y.end());
  }
  for (const PlotLine& line : plot.lines) ys.push_back(line.y);
  for (const PlotBand& band : plot.bands) (band.on_x ? xs : ys).push_back(band.to);

  int rows = 0;
  const std::string legend = DrawLegend(LegendOf(plot), 0, &rows);
  const double top = kTop + kLegendRow * rows;
  const Axis x = MakeAxis(plot.x, xs, kLeft, kWidth - kRight);
  const Axis y = MakeAxis(plot.y, ys, top + kPlotHeight, top);

  *height = top + kPlotHeight + kBottom;
  std::string svg = legend;
  for (const PlotBand& band : plot.bands) svg += DrawBand(band, x, y);
  svg += DrawAxes(plot, x, y);
  for (const PlotLine& line : plot.lines) {
    const std::string at = Pixel(y.Pixel(line.y));
    absl::StrAppend(&svg, "<line class=\"limit\" x1=\"", Pixel(x.from_px), "\" x2=\"",
                    Pixel(x.to_px), "\" y1=\"", at, "\" y2=\"", at, "\"/>\n");
  }
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    absl::StrAppend(&svg, DrawSeries(plot.series[i], i, x, y));
  }
  return svg;
}

}  // namespace

absl::StatusOr<std::string> DrawPlot(const Plot& plot) {
  double height = 0;
  const absl::StatusOr<std::string> inside = DrawInside(plot, &height);
  if (!inside.ok()) return inside.status();
  return absl::StrCat("<svg viewBox=\"0 0 ", kWidth, " ", height, "\" role=\"img\" aria-label=\"",
                      HtmlEscape(plot.title), "\">\n", *inside, "</svg>\n");
}

absl::StatusOr<std::string> DrawPicture(const Plot& plot) {
  double height = 0;
  const absl::StatusOr<std::string> inside = DrawInside(plot, &height);
  if (!inside.ok()) return inside.status();
  const std::string box = absl::StrCat(kWidth, "\" height=\"", height + kTitleHeight, "\"");
  return absl::StrCat("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"", box, " viewBox=\"0 -",
                      kTitleHeight, " ", kWidth, " ", height + kTitleHeight, "\">\n<style>",
                      SvgStyle(), "</style>\n<title>", HtmlEscape(plot.title),
                      "</title>\n<rect class=\"ground\" y=\"-", kTitleHeight, "\" width=\"", box,
                      " rx=\"6\"/>\n<text class=\"title\" x=\"", kLeft, "\" y=\"-10\">",
                      HtmlEscape(plot.title), "</text>\n", *inside, "</svg>\n");
}

std::string DrawPlots(const std::vector<Plot>& plots) {
  std::string html = "<div class=\"plots\">\n";
  for (const Plot& plot : plots) {
    const absl::StatusOr<std::string> svg = DrawPlot(plot);
    absl::StrAppend(&html, "<figure><figcaption>", HtmlEscape(plot.title), "</figcaption>",
                    svg.ok() ? *svg : HtmlEscape(svg.status().ToString()), "</figure>\n");
  }
  return html + "</div>\n";
}

}  // namespace adhesim
