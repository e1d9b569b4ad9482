#include "clients/cli/svg_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <regex>
#include <string>
#include <vector>

#include "clients/cli/html_report.h"

namespace adhesim {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Plot Line(std::vector<double> x, std::vector<double> y) {
  Plot plot;
  plot.title = "title";
  plot.x.label = "time, s";
  plot.y.label = "energy, J";
  PlotSeries& curve = plot.series.emplace_back();
  curve.name = "curve";
  curve.x = std::move(x);
  curve.y = std::move(y);
  return plot;
}

std::string Draw(const Plot& plot) {
  const absl::StatusOr<std::string> svg = DrawPlot(plot);
  EXPECT_TRUE(svg.ok()) << svg.status();
  return svg.ok() ? *svg : "";
}

// Every coordinate of the first curve: x and y by turns.
std::vector<double> Points(const std::string& svg) {
  std::smatch match;
  const std::regex curve("class=\"curve[^\"]*\" points=\"([^\"]*)\"");
  std::vector<double> numbers;
  if (!std::regex_search(svg, match, curve)) return numbers;
  const std::string points = match[1];
  for (const char* at = points.c_str(); *at != '\0';) {
    char* end = nullptr;
    numbers.push_back(std::strtod(at, &end));
    at = *end == '\0' ? end : end + 1;
  }
  return numbers;
}

int Count(const std::string& text, const std::string& what) {
  int count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) {
    ++count;
  }
  return count;
}

TEST(SvgPlot, DrawsEveryPointInsideItsFrame) {
  const std::string svg = Draw(Line({0, 1, 2}, {-5, 10, 3}));
  const std::vector<double> points = Points(svg);
  ASSERT_EQ(points.size(), 6u);
  for (std::size_t i = 0; i < 6; i += 2) {
    EXPECT_GE(points[i], 66);
    EXPECT_LE(points[i], 496);
    EXPECT_GE(points[i + 1], 0);
    EXPECT_LE(points[i + 1], 260);
  }
  EXPECT_LT(points[3], points[5]);  // 10 is drawn above 3
  EXPECT_LT(points[5], points[1]);
  for (const char* part : {"role=\"img\"", "aria-label=\"title\"", ">time, s<", ">energy, J<",
                           ">curve<", ">-6<", ">10<"}) {
    EXPECT_THAT(svg, HasSubstr(part));
  }
}

TEST(SvgPlot, DrawsAPictureThatStandsAloneAndTellsOneKindOfPointsFromAnother) {
  Plot plot = Line({1, 2}, {1, 2});
  plot.title = "ours & theirs";
  plot.series[0].markers = true;
  plot.series.push_back(plot.series[0]);
  plot.series[1].name = "theirs";
  plot.series[1].diamonds = true;
  const absl::StatusOr<std::string> picture = DrawPicture(plot);
  ASSERT_TRUE(picture.ok()) << picture.status();
  EXPECT_THAT(*picture, ::testing::StartsWith("<svg xmlns="));
  for (const char* part : {"<style>", "--card:", "prefers-color-scheme: dark", "class=\"ground\"",
                           ">ours &amp; theirs</text>"}) {
    EXPECT_THAT(*picture, HasSubstr(part));
  }
  // Two points each, and one in the legend.
  EXPECT_EQ(Count(*picture, "<circle class=\"dot s0\""), 3);
  EXPECT_EQ(Count(*picture, "<path class=\"dot s1\""), 3);
  plot.x.scale = PlotScale::kLog;
  plot.series[0].x[0] = -1;
  EXPECT_FALSE(DrawPicture(plot).ok());
}

TEST(SvgPlot, EscapesEveryName) {
  Plot plot = Line({0, 1}, {0, 1});
  plot.title = plot.x.label = plot.y.label = "<b> & \"c\"";
  plot.series[0].name = "</svg><script>";
  plot.series[0].markers = true;
  plot.series[0].point_names = {"<i>", "'j'"};
  plot.lines.push_back({"<limit>", 1});
  const std::string svg = Draw(plot);
  for (const char* raw : {"<b>", "<script>", "<i>", "<limit>", "'j'"}) {
    EXPECT_THAT(svg, Not(HasSubstr(raw)));
  }
  EXPECT_THAT(svg, HasSubstr("&lt;b&gt; &amp; &quot;c&quot;"));
  EXPECT_EQ(Count(svg, "</svg>"), 1);
}

TEST(SvgPlot, LogarithmicAxesAreEvenInDecades) {
  Plot plot = Line({1, 10, 100}, {0.01, 1, 100});
  plot.x.scale = plot.y.scale = PlotScale::kLog;
  const std::string svg = Draw(plot);
  const std::vector<double> points = Points(svg);
  ASSERT_EQ(points.size(), 6u);
  // Coordinates are printed to a tenth of a pixel.
  EXPECT_NEAR(points[2] - points[0], points[4] - points[2], 0.11);
  EXPECT_NEAR(points[3] - points[1], points[5] - points[3], 0.11);
  EXPECT_THAT(svg, HasSubstr(">0.01<"));
  EXPECT_THAT(svg, HasSubstr(">100<"));
}

TEST(SvgPlot, RefusesWhatAnAxisCannotShow) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), -1e101}) {
    const absl::Status status = DrawPlot(Line({0, 1}, {0, bad})).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << bad;
    EXPECT_THAT(std::string(status.message()), HasSubstr("'curve'"));
    EXPECT_FALSE(DrawPlot(Line({0, bad}, {0, 1})).ok());
    Plot limited = Line({0, 1}, {0, 1});
    limited.lines.push_back({"limit", bad});
    EXPECT_FALSE(DrawPlot(limited).ok());
  }
  Plot logarithmic = Line({1, 2}, {1, 0});
  EXPECT_TRUE(DrawPlot(logarithmic).ok());
  logarithmic.y.scale = PlotScale::kLog;
  EXPECT_TRUE(absl::IsInvalidArgument(DrawPlot(logarithmic).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(DrawPlot(Line({0, 1, 2}, {0, 1})).status()));
}

TEST(SvgPlot, ShowsASeriesWithoutPointsInTheLegend) {
  const std::string svg = Draw(Line({}, {}));
  EXPECT_THAT(svg, HasSubstr(">curve (none)<"));
  EXPECT_EQ(Points(svg).size(), 0u);
  EXPECT_THAT(svg, HasSubstr("class=\"axis\""));
}

TEST(SvgPlot, CopesWithRangesOfEverySize) {
  for (const std::vector<double>& y : {std::vector<double>{0, 0},
                                       {5, 5},
                                       {-5, -5},
                                       {1, 1 + 1e-15},
                                       {1e-300, 0},
                                       {-1e100, 1e100},
                                       {1e-90, 2e-90},
                                       {1e9, 1e9 + 1}}) {
    const std::string svg = Draw(Line({0, 1}, y));
    EXPECT_THAT(svg, Not(HasSubstr("nan"))) << y[1];
    EXPECT_THAT(svg, Not(HasSubstr("inf"))) << y[1];
    EXPECT_GE(Count(svg, "class=\"tick\""), 4) << y[1];
    EXPECT_LE(Count(svg, "class=\"tick\""), 40) << y[1];
  }
}

TEST(SvgPlot, AxesBeginAtZeroWhereAsked) {
  Plot plot = Line({0, 1}, {7, 9});
  EXPECT_EQ(Count(Draw(plot), ">0<"), 1);  // that of x
  plot.y.from_zero = true;
  EXPECT_EQ(Count(Draw(plot), ">0<"), 2);
  plot.series[0].y = {0.1, 0.1};
  EXPECT_THAT(Draw(plot), Not(HasSubstr(">-0")));
}

TEST(HtmlReport, APageFetchesNothing) {
  const std::string page = HtmlPage("a < b", "<p>text</p>");
  EXPECT_THAT(page, HasSubstr("<title>a &lt; b</title>"));
  EXPECT_THAT(page, HasSubstr("prefers-color-scheme: dark"));
  for (const char* fetched : {"http:", "https:", "<script", "<link", "@import", "url("}) {
    EXPECT_THAT(page, Not(HasSubstr(fetched)));
  }
}

TEST(HtmlReport, TablesNameTheirRowsAndColumns) {
  const std::string html = ToHtml({"caption", {"what", "how much"}, {false, true}, {{"a", "1"}}});
  EXPECT_THAT(html, HasSubstr("<caption>caption</caption>"));
  EXPECT_THAT(html, HasSubstr("<th scope=\"col\" class=\"number\">how much</th>"));
  EXPECT_THAT(html, HasSubstr("<th scope=\"row\">a</th><td class=\"number\">1</td>"));
}

}  // namespace
}  // namespace adhesim
