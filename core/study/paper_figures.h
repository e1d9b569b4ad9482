#pragma once

#include <optional>
#include <span>
#include <string_view>

namespace adhesim {

// What a figure tells, beyond what every scene must keep.
enum class Story {
  kNone,
  kEndsTogether,  // bodies that met still touch at the end
  kEndsApart,     // bodies that met have parted at the end
  kAggregates,    // more and more particles in contact, the whole ever denser
  kRolls,         // the followed body rolls
  kHoldsAll,      // every body holds on to the others at the end
  kOneZone,       // one zone holds every body at the end
  kPulls,         // the followed body is pulled by the others, which hold it, and let go again
  kHangs,         // the followed body hangs from the others, at rest at the end
};

// One experiment of the paper (Carra, Martiel, Promayon, VRIPHYS 2007, section 5), or one of what
// its text has and its figures do not. Its own numbers stand as the paper prints them.
struct PaperFigure {
  std::string_view scene;   // file below the directory of scenes, without ".yaml"
  std::string_view figure;  // "Fig. 2"
  std::string_view title;
  std::string_view paper_says;
  double duration_s = 0;
  std::span<const double> instants;         // of the pictures, fractions of the duration, ascending
  std::string_view instants_note;           // where they come from
  std::optional<int> particles, triangles;  // the paper's
  // Detection and response as the paper timed them: the number, and whether it is only a bound.
  std::optional<double> paper_ms;
  bool paper_ms_is_bound = false;
  std::optional<double> budget_ms;  // the project's own bound on the median of a step's CPU time
  Story story = Story::kNone;
  std::string_view followed =
      "";              // name of the body that the story is about; empty: of no single one
  bool large = false;  // left out of quick runs
};

// Every figure, in the paper's order. A new one is one entry.
std::span<const PaperFigure> PaperFigures();

}  // namespace adhesim
