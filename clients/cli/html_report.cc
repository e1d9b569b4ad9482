#include "clients/cli/html_report.h"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

namespace adhesim {
namespace {

// Series keep their order of hue in both themes; each is told apart from its background by a
// contrast of at least 3:1 (WCAG 2.1, 1.4.11), text by 4.5:1.
constexpr std::string_view kColours = R"(
:root {
  color-scheme: light dark;
  --page: #fbfbfa; --card: #ffffff; --ink: #1d2329; --soft: #59636e; --rule: #d7dbe0;
  --grid: #e8eaed; --good: #10703c; --bad: #b3261e; --limit: #8a4b00;
  --s0: #2463c4; --s1: #c2540a; --s2: #0f7a5a; --s3: #8a3fb0; --s4: #7a6a00;
  --s5: #b0305f; --s6: #00717d; --s7: #5d5d5d;
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #14171a; --card: #1b1f24; --ink: #e6e9ec; --soft: #a2adb8; --rule: #39414a;
    --grid: #2b3138; --good: #5fd08f; --bad: #ff8a80; --limit: #f0b35a;
    --s0: #78aaff; --s1: #ff9d5c; --s2: #58d0a5; --s3: #d59bf2; --s4: #d9c64a;
    --s5: #ff8fb8; --s6: #4fd0dd; --s7: #b5b5b5;
  }
}
)";

constexpr std::string_view kStyle = R"(* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem clamp(1rem, 4vw, 3rem) 4rem; max-width: 76rem;
  background: var(--page); color: var(--ink); font: 1rem/1.5 system-ui, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .2rem; padding-top: 1rem; border-top: 1px solid var(--rule); }
h3 { font-size: 1rem; margin: 1.4rem 0 .3rem; }
p { max-width: 46rem; margin: .4rem 0; }
.soft { color: var(--soft); font-size: .9rem; }
a { color: var(--s0); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; margin: .6rem 0; }
caption { text-align: left; color: var(--soft); padding-bottom: .3rem; }
th, td { text-align: left; padding: .3rem 1.2rem .3rem 0; border-bottom: 1px solid var(--rule);
  vertical-align: top; }
th { font-weight: 600; }
tbody th { font-weight: 400; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.holds { color: var(--good); font-weight: 600; white-space: nowrap; }
.fails { color: var(--bad); font-weight: 700; white-space: nowrap; }
.unjudged { color: var(--soft); white-space: nowrap; }
.wide { display: inline-block; min-width: 15rem; }
.strip { display: grid; gap: .8rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 13rem), 1fr));
  margin: .8rem 0; }
.plots { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 27rem), 1fr));
  margin: .8rem 0; }
figure { margin: 0; max-width: 42rem; background: var(--card); border: 1px solid var(--rule); border-radius: 6px; padding: .6rem; }
figure img { width: 100%; height: auto; display: block; border-radius: 3px; }
figcaption { font-size: .88rem; color: var(--soft); }
.plots figcaption { color: var(--ink); font-weight: 600; margin-bottom: .2rem; }
@media print { body { max-width: none; } figure { break-inside: avoid; } }
svg { width: 100%; height: auto; display: block; }
)";

constexpr std::string_view kSvgStyle = R"(svg { font: 12px system-ui, sans-serif; }
svg text { fill: var(--ink); }
svg .tick { fill: var(--soft); }
svg .grid { stroke: var(--grid); }
svg .axis { stroke: var(--soft); fill: none; }
svg .curve { fill: none; stroke-width: 2; stroke-linejoin: round; }
svg .dashed { stroke-dasharray: 7 4; }
svg .limit { stroke: var(--limit); stroke-width: 1.5; stroke-dasharray: 2 3; }
svg .s0 { stroke: var(--s0); } svg .s1 { stroke: var(--s1); } svg .s2 { stroke: var(--s2); }
svg .s3 { stroke: var(--s3); } svg .s4 { stroke: var(--s4); }
svg .s5 { stroke: var(--s5); } svg .s6 { stroke: var(--s6); } svg .s7 { stroke: var(--s7); }
svg .band { fill: var(--grid); stroke: none; }
svg .grey { stroke: var(--grid); stroke-width: 12; }
svg .dot { fill: var(--card); stroke-width: 2; }
svg .ground { fill: var(--card); }
svg .title { font-weight: 600; font-size: 14px; }
)";

std::string View(std::string_view text) { return {text.data(), text.size()}; }

}  // namespace

std::string HtmlEscape(std::string_view text) {
  return absl::StrReplaceAll(
      absl::string_view(text.data(), text.size()),
      {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

std::string ToHtml(const HtmlTable& table) {
  std::string html = "<div class=\"scroll\"><table>";
  if (!table.caption.empty()) absl::StrAppend(&html, "<caption>", table.caption, "</caption>");
  const auto flush = [&](std::size_t column) {
    return table.numeric[column] ? " class=\"number\"" : "";
  };
  absl::StrAppend(&html, "<thead><tr>");
  for (std::size_t i = 0; i < table.headers.size(); ++i) {
    absl::StrAppend(&html, "<th scope=\"col\"", flush(i), ">", table.headers[i], "</th>");
  }
  absl::StrAppend(&html, "</tr></thead>\n<tbody>");
  for (const std::vector<std::string>& row : table.rows) {
    absl::StrAppend(&html, "<tr>");
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i == 0) {
        absl::StrAppend(&html, "<th scope=\"row\">", row[i], "</th>");
      } else {
        absl::StrAppend(&html, "<td", flush(i), ">", row[i], "</td>");
      }
    }
    absl::StrAppend(&html, "</tr>\n");
  }
  absl::StrAppend(&html, "</tbody></table></div>\n");
  return html;
}

std::string HtmlParagraph(std::string_view html, std::string_view kind) {
  return absl::StrCat(kind.empty() ? "<p>" : absl::StrCat("<p class=\"", std::string(kind), "\">"),
                      std::string(html), "</p>\n");
}

std::string PngAddress(std::string_view png) {
  return absl::StrCat("data:image/png;base64,",
                      absl::Base64Escape(absl::string_view(png.data(), png.size())));
}

std::string SvgStyle() { return View(kColours) + View(kSvgStyle); }

std::string HtmlPage(std::string_view title, std::string_view body) {
  return absl::StrCat(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>",
      HtmlEscape(title), "</title>\n<style>", View(kColours), View(kStyle), View(kSvgStyle),
      "</style>\n</head>\n<body>\n", absl::string_view(body.data(), body.size()),
      "</body>\n</html>\n");
}

}  // namespace adhesim
