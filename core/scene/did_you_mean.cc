#include "core/scene/did_you_mean.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <vector>

namespace adhesim {
namespace {

// Longer texts are no misspelt names, and the distance is quadratic in the length.
constexpr std::size_t kLongestName = 64;
constexpr std::size_t kMostCandidates = 1000;
constexpr std::size_t kLongestQuote = 60;

// Insertions, deletions, replacements and swaps of neighbours that turn `a` into `b`.
std::size_t EditDistance(absl::string_view a, absl::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replace = d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, replace});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

std::string NearestName(absl::string_view text, std::span<const std::string> candidates) {
  if (text.empty() || text.size() > kLongestName) return "";
  std::string best;
  // One edit in every three letters, and never most of the word.
  std::size_t best_distance = std::min((text.size() + 2) / 3, text.size() / 2) + 1;
  for (const std::string& candidate :
       candidates.first(std::min(candidates.size(), kMostCandidates))) {
    if (candidate.size() > kLongestName) continue;
    const bool lacks_words = absl::StartsWith(candidate, absl::StrCat(text, "_"));
    const std::size_t distance = lacks_words ? 1 : EditDistance(text, candidate);
    if (distance < best_distance) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

std::string DidYouMean(absl::string_view text, std::span<const std::string> candidates) {
  const std::string name = NearestName(text, candidates);
  return name.empty() ? "" : absl::StrCat(" (did you mean '", name, "'?)");
}

std::string Quoted(absl::string_view text) {
  if (text.size() <= kLongestQuote) return absl::StrCat("'", text, "'");
  std::size_t cut = kLongestQuote;
  while (cut > 0 && (static_cast<unsigned char>(text[cut]) & 0xC0) == 0x80) --cut;
  return absl::StrCat("'", text.substr(0, cut), "...'");
}

}  // namespace adhesim
