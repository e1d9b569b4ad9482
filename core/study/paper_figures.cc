#include "core/study/paper_figures.h"

#include <array>

namespace adhesim {
namespace {

// Fractions of the duration at which pictures are taken.
constexpr std::array<double, 4> kFourEven = {0, 1.0 / 3, 2.0 / 3, 1};
constexpr std::array<double, 4> kFig3 = {0, 1.0 / 6, 1.0 / 3, 1};
constexpr std::array<double, 4> kFig6 = {0, 0.25, 0.5, 1};  // t = 0, 100, 200 and 400 s

constexpr std::string_view kEven = "the paper gives no times; evenly spread here";
constexpr std::string_view kFig3Note =
    "the paper gives no times; chosen where the pair meets, parts or holds, and ends";
constexpr std::string_view kFig6Note =
    "the paper's t = 0, 100, 200 and 400 s as fractions of 400 s";

constexpr PaperFigure kFigures[] = {
    {
        .scene = "six_spheres_on_plane",
        .figure = "Fig. 2",
        .title = "Six spheres fall on an elastic plane",
        .paper_says = "An interpenetration-free situation: neither do spheres overlap, nor does "
                      "the lowest one intersect the plane.",
        .duration_s = 6,
        .instants = kFourEven,
        .instants_note = kEven,
        .particles = 693,
        .triangles = 1280,
        .paper_ms = 549,
        .budget_ms = 0.25,
    },
    {
        .scene = "two_cells_sticky",
        .figure = "Fig. 3, top",
        .title = "Two very adhesive cells",
        .paper_says = "The spheres collide, slide on one another, and are still in contact in "
                      "the last picture.",
        .duration_s = 5,
        .instants = kFig3,
        .instants_note = kFig3Note,
        .particles = 84,
        .triangles = 160,
        .paper_ms = 10,
        .paper_ms_is_bound = true,
        .budget_ms = 0.021,
        .story = Story::kEndsTogether,
    },
    {
        .scene = "two_cells_slippery",
        .figure = "Fig. 3, bottom",
        .title = "Two less sticky cells",
        .paper_says = "The same with a lower strength: in the last picture they have parted.",
        .duration_s = 5,
        .instants = kFig3,
        .instants_note = kFig3Note,
        .particles = 84,
        .triangles = 160,
        .paper_ms = 2,
        .paper_ms_is_bound = true,
        .budget_ms = 0.021,
        .story = Story::kEndsApart,
    },
    {
        .scene = "cell_aggregation",
        .figure = "Fig. 6",
        .title = "25 cells aggregate",
        .paper_says = "Cells regroup little by little into one aggregate, with no empty space "
                      "inside; the share of colliding particles rises.",
        .duration_s = 4,
        .instants = kFig6,
        .instants_note = kFig6Note,
        .particles = 1050,
        .triangles = 2000,
        .paper_ms = 777,
        .budget_ms = 0.40,
        .story = Story::kAggregates,
    },
};

}  // namespace

std::span<const PaperFigure> PaperFigures() { return kFigures; }

}  // namespace adhesim
