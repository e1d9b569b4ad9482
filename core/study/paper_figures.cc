#include "core/study/paper_figures.h"

#include <array>

namespace adhesim {
namespace {

// Fractions of the duration at which pictures are taken.
constexpr std::array<double, 4> kFourEven = {0, 1.0 / 3, 2.0 / 3, 1};
constexpr std::array<double, 4> kFig3 = {0, 0.1, 1.0 / 6, 1.0 / 3};
// t = 0, 40, 80, 120 and 160 s
constexpr std::array<double, 5> kFig4 = {0, 0.25, 0.5, 0.75, 1};
constexpr std::array<double, 4> kFig6 = {0, 0.25, 0.5, 1};  // t = 0, 100, 200 and 400 s
// Its schedule: tensed from 0.2 to 0.7 s, held until 2 s, let go until 2.5 s.
constexpr std::array<double, 4> kMuscle = {0.05, 0.175, 0.5, 1};

constexpr std::string_view kText = "The paper's text";
constexpr std::string_view kEven = "the paper gives no times; evenly spread here";
constexpr std::string_view kFig3Note =
    "the paper gives no times; chosen where the pair meets, slides, and parts or holds";
constexpr std::string_view kFig4Note =
    "the paper's t = 0, 40, 80, 120 and 160 s as fractions of 160 s";
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
        .scene = "rolling_ball",
        .figure = "Fig. 4",
        .title = "A ball rolls on an elastic plane",
        .paper_says = "The ball rolls; the plane deforms where it sticks to the ball, and adhesion "
                      "makes the rolling imperfect.",
        .duration_s = 2,
        .instants = kFig4,
        .instants_note = kFig4Note,
        .particles = 217,
        .triangles = 368,
        .paper_ms = 33,
        .budget_ms = 0.07,
        .story = Story::kRolls,
        .followed = "ball",
    },
    {
        .scene = "four_bunnies",
        .figure = "Fig. 5",
        .title = "Four sticky bunnies collide",
        .paper_says = "All sticky contacts are resolved; the method is not limited to spheres. The "
                      "paper's counts leave room for four equal bunnies only with an open sheet, "
                      "on which they land here.",
        .duration_s = 4,
        .instants = kFourEven,
        .instants_note = kEven,
        .particles = 567,
        .triangles = 1040,
        .paper_ms = 576,
        .budget_ms = 0.2,
        .story = Story::kHoldsAll,
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
    {
        .scene = "muscle_between_bones",
        .figure = kText,
        .title = "A muscle between two bones",
        .paper_says = "Elastic or contractile objects can be linked to rigid ones, such as a "
                      "muscle to bones (section 3.3, Alg. 2): it pulls the free bone, and holds "
                      "on to both.",
        .duration_s = 4,
        .instants = kMuscle,
        .instants_note = "slack, tensed, just before it is let go, and slack again",
        .particles = std::nullopt,
        .triangles = std::nullopt,
        .paper_ms = std::nullopt,
        .budget_ms = std::nullopt,
        .story = Story::kPulls,
        .followed = "free_bone",
    },
    {
        .scene = "rigid_on_elastic",
        .figure = kText,
        .title = "A rigid ball hangs from an elastic sheet",
        .paper_says = "A rigid object can be linked to an elastic one (section 3.3): the sheet "
                      "carries what hangs from it.",
        .duration_s = 6,
        .instants = kFourEven,
        .instants_note = kEven,
        .particles = std::nullopt,
        .triangles = std::nullopt,
        .paper_ms = std::nullopt,
        .budget_ms = std::nullopt,
        .story = Story::kHangs,
        .followed = "ball",
    },
    {
        .scene = "zone_of_three",
        .figure = kText,
        .title = "Three balls in one virtual adhesive",
        .paper_says = "Virtual adhesives that grow until they touch become one (section 4.2.2), "
                      "whatever the number of bodies.",
        .duration_s = 2,
        .instants = kFourEven,
        .instants_note = kEven,
        .particles = std::nullopt,
        .triangles = std::nullopt,
        .paper_ms = std::nullopt,
        .budget_ms = std::nullopt,
        .story = Story::kOneZone,
    },
    {
        .scene = "cell_aggregation_x10",
        .figure = "Beyond Fig. 6",
        .title = "250 cells pressed together",
        .paper_says = "Not in the paper: how the cost grows.",
        .duration_s = 1,
        .instants = kFourEven,
        .instants_note = "evenly spread",
        .particles = std::nullopt,
        .triangles = std::nullopt,
        .paper_ms = std::nullopt,
        .budget_ms = 5,
        .large = true,
    },
    {
        .scene = "cell_aggregation_x100",
        .figure = "Beyond Fig. 6",
        .title = "2500 cells pressed together",
        .paper_says = "Not in the paper: how the cost grows.",
        .duration_s = 0.5,
        .instants = kFourEven,
        .instants_note = "evenly spread",
        .particles = std::nullopt,
        .triangles = std::nullopt,
        .paper_ms = std::nullopt,
        .budget_ms = 60,
        .large = true,
    },
};

}  // namespace

std::span<const PaperFigure> PaperFigures() { return kFigures; }

}  // namespace adhesim
