#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace adhesim {

// Parts of pages that stand alone: one file, no scripts, nothing fetched, light or dark as the
// reader's system is.

// Text as it may stand in an element or a quoted attribute.
std::string HtmlEscape(std::string_view text);

// Cells are HTML. The first column names the row; `numeric` columns are set flush right.
struct HtmlTable {
  std::string caption;
  std::vector<std::string> headers;
  std::vector<bool> numeric;  // as many as headers
  std::vector<std::vector<std::string>> rows;
};
std::string ToHtml(const HtmlTable& table);

// A paragraph of HTML; `kind` is a class of the style sheet ("soft"), or empty.
std::string HtmlParagraph(std::string_view html, std::string_view kind = "");

// The bytes of a PNG file as an image's address.
std::string PngAddress(std::string_view png);

// The colours and rules of <svg> elements on these pages, for pictures that stand alone.
std::string SvgStyle();

// A whole page; `body` is HTML.
std::string HtmlPage(std::string_view title, std::string_view body);

}  // namespace adhesim
