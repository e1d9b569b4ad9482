#include "core/study/stress_cases.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

namespace adhesim {
namespace {

using Figures = const StressFigures&;
using Shows = const char* (*)(Figures);

// What each case must have been, to be the case that it says it is.
const char* Touches(Figures f) { return f.captures > 0 ? nullptr : "nothing touched"; }
const char* LetsGo(Figures f) { return f.releases > 0 ? nullptr : "nothing let go"; }
const char* HoldsForEver(Figures f) {
  if (f.captures == 0) return "nothing touched";
  return f.releases == 0 ? nullptr : "an adhesive without a limit let go";
}
const char* DoesNotChatter(Figures f) {
  if (f.captures == 0) return "nothing touched";
  return f.captures <= 200 ? nullptr : "contacts stick again and again";
}
const char* ZoneOfOne(Figures f) {
  return f.most_zone_members == 1 ? nullptr : "no zone, or one with more than one particle";
}
const char* ZoneOfTwo(Figures f) {
  return f.most_zone_members == 2 ? nullptr : "no zone of two particles";
}
const char* ZoneOfThree(Figures f) {
  return f.most_zone_bodies >= 3 ? nullptr : "no zone of three bodies";
}
const char* ZonesOfPatches(Figures f) { return f.most_zones >= 4 ? nullptr : "fewer than 4 zones"; }
const char* Merges(Figures f) {
  return f.fewer_zones >= 1000 ? nullptr : "fewer than 1,000 zones merged in one step";
}
const char* Disagrees(Figures f) {
  return f.bits & kStepZoneSplitForced ? nullptr : "the tools never met in one zone";
}
const char* Overlaps(Figures f) {
  return f.overlap_m > 0.005 ? nullptr : "no deep overlap at the start";
}
const char* DoesNotCreep(Figures f) {
  if (f.captures == 0) return "nothing touched";
  return f.drift_m < 1e-9 ? nullptr : "it moved in the second half";
}
const char* Stays(Figures f) {
  if (f.captures == 0) return "nothing touched";
  return f.drift_m < 1e-3 ? nullptr : "it slid";
}
// 0.49 leaves 0.0877 m/s^2 down the slope: 44 mm in a second, of which it may lose a third.
const char* Slides(Figures f) { return f.moved_m > 0.03 ? nullptr : "it did not slide"; }
const char* Stands(Figures f) {
  if (f.captures == 0) return "nothing touched";
  return f.drift_m < 0.005 ? nullptr : "it does not stand still";
}
const char* IsThrough(Figures f) {
  if (f.captures == 0) return "nothing touched";
  return f.fallen_m > 0.03 ? nullptr : "it is stuck";
}
// All that its coupling has: there is nowhere for the tissue to go.
const char* PressesHard(Figures f) { return f.peak_force_n > 90 ? nullptr : "the tissue gave way"; }
const char* Pulls(Figures f) { return f.peak_force_n > 0.1 ? nullptr : "the tool felt nothing"; }

// A lattice of cubes below the plate's lower face, each a zone by itself.
void AddCubes(v1::Scene* scene) {
  for (int i = 0; i < 32; ++i) {
    for (int k = 0; k < 32; ++k) {
      v1::Body* cube = scene->add_bodies();
      cube->set_name(absl::StrCat("cube-", i, "-", k));
      for (int axis = 0; axis < 3; ++axis) cube->mutable_block()->add_size_m(0.01);
      cube->mutable_block()->set_cells(1);
      cube->add_position_m(0.02 * i - 0.31);
      cube->add_position_m(0.02 * k - 0.31);
      cube->add_position_m(0);
      cube->set_mass_kg(0.001);
      cube->set_kind(v1::BODY_KIND_RIGID);
    }
  }
}

constexpr StressConditions kNoRest{};
constexpr StressConditions RestBy(double s) { return {s, std::nullopt}; }
// A hundredth of what the case has by itself.
constexpr StressConditions GainsAtMost(double j) { return {std::nullopt, j}; }

const StressCase kCases[] = {
    // Shape: what has lost it comes back.
    {"flattened_to_a_plane", "shape", "soft_block", "tissue squashed into a plane", 4, RestBy(3),
     nullptr, Flatten},
    {"flattened_to_a_point", "shape", "soft_block", "all of its particles in one point", 4,
     RestBy(3), nullptr, Collapse},
    {"inverted", "shape", "soft_block", "tissue turned inside out", 4, RestBy(3), nullptr,
     TurnInsideOut},
    {"strewn", "shape", "soft_block", "particles moved by half a cell", 4, RestBy(3), nullptr,
     Strew},
    {"scrambled", "shape", "soft_block", "particles anywhere in the block", 4, RestBy(3), nullptr,
     Scramble},
    {"twist_4_turns", "shape", "soft_bar", "a bar twisted by four turns", 4, RestBy(3), nullptr,
     TwistFourTurns},
    {"stretch_10x", "shape", "soft_bar", "a bar stretched to ten times its length", 4, RestBy(3),
     nullptr, StretchTenfold},
    {"cell_flattened", "shape", "cell", "a cell squashed into a plane", 4, RestBy(3), nullptr,
     Flatten},
    {"cell_scrambled", "shape", "cell", "a cell whose particles are anywhere", 4, RestBy(3),
     nullptr, Scramble},
    {"cell_inside_out", "shape", "cell", "a cell turned inside out", 4, RestBy(3), nullptr,
     TurnInsideOut, nullptr, nullptr, nullptr, false,
     "a surface alone does not know its inside: inside out it is at rest"},
    {"filled_cell_flattened", "shape", "filled_cell", "a cell of constant volume without any", 4,
     RestBy(3), nullptr, Flatten},
    // Contrast: stiffness and mass.
    {"stiff_beside_soft", "contrast", "stiff_beside_soft", "stiffness 10^6 : 1 side by side", 2,
     kNoRest},
    {"youngs_sweep", "contrast", "youngs_sweep", "cubes of 10^2 to 10^8 Pa", 1, kNoRest, Touches},
    {"heavy_on_light", "contrast", "heavy_on_light", "80 kg on 8 g", 1, kNoRest, Stands},
    {"light_on_heavy", "contrast", "light_on_heavy", "8 g on 80 kg", 1, kNoRest, Stands},
    {"nearly_incompressible", "contrast", "nearly_incompressible", "nu 0.499 under a probe", 1.5,
     kNoRest, Pulls},
    {"swings_on_hinge", "contrast", "swings_on_hinge", "1 MPa held along an edge, falls to it", 3,
     GainsAtMost(1.1e-4)},
    {"spins_about_pin", "contrast", "spins_about_pin", "7 MPa held in its middle, spins", 1,
     GainsAtMost(3e-6)},
    {"spins_freely", "contrast", "spins_freely", "a ball of 7 MPa that spins", 1,
     GainsAtMost(3e-6)},
    {"feather", "contrast", "feather", "a milligram between two balls", 1, kNoRest, Touches},
    // Meshes.
    {"sliver_tets", "mesh", "sliver_tets", "tetrahedra a thousand times as wide as high", 1,
     kNoRest},
    {"reversed_tets", "mesh", "reversed_tets", "tetrahedra the wrong way round", 1, kNoRest},
    {"flat_tet", "mesh", "flat_tet", "a tetrahedron without volume", 1, kNoRest, nullptr, nullptr,
     nullptr, nullptr, "a tetrahedron without volume"},
    {"zero_area_triangle", "mesh", "zero_area_triangle", "a triangle without area, carried", 1,
     kNoRest},
    {"zero_area_surface", "mesh", "zero_area_surface", "a triangle without area, by itself", 1,
     kNoRest, nullptr, nullptr, nullptr, nullptr, "degenerate triangle"},
    {"coincident_vertices", "mesh", "coincident_vertices", "vertices in the same places", 1,
     kNoRest},
    {"open_surface", "mesh", "open_surface", "a box without a lid", 1, kNoRest},
    {"non_manifold", "mesh", "non_manifold", "two boxes that share an edge, carried", 1, kNoRest},
    {"non_manifold_surface", "mesh", "non_manifold_surface", "the same by themselves", 1, kNoRest,
     nullptr, nullptr, nullptr, nullptr, "non-manifold edge"},
    // Tools.
    {"squeezed_flat", "tools", "squeezed_flat", "squeezed until nothing is left, then freed", 3,
     RestBy(2.5), Pulls, nullptr, nullptr, nullptr, nullptr, false,
     "tissue wrapped around the tools tangles and does not come free"},
    {"needle_1_m_s", "tools", "needle_1_m_s", "needle at 1 m/s, membrane of 1 mm", 0.3, kNoRest,
     Pulls},
    {"needle_5_m_s", "tools", "needle_5_m_s", "needle at 5 m/s, membrane of 1 mm", 0.3, kNoRest,
     Pulls},
    {"needle_10_m_s", "tools", "needle_10_m_s", "needle at 10 m/s, membrane of 1 mm", 0.3, kNoRest,
     Pulls},
    {"tool_teleport", "tools", "tool_teleport", "targets half a metre away, below the tissue", 1.5,
     kNoRest, Pulls},
    {"tool_jitter", "tools", "tool_jitter", "5 mm of jitter at 1 kHz", 0.9, kNoRest, Pulls, nullptr,
     Jitter},
    {"tool_yank", "tools", "tool_yank", "yanked at 10 m/s while stuck for good", 0.8, kNoRest,
     Pulls},
    {"stiff_under_needle", "tools", "stiff_under_needle", "needle of 50 g on 7 MPa at 200 Hz", 0.9,
     kNoRest, Pulls},
    {"slides_on_stiff_tissue", "tools", "slides_on_stiff_tissue", "24 g slide on 2 MPa, mu 1.5",
     0.6, kNoRest, Pulls},
    {"two_tools_disagree", "tools", "two_tools_disagree", "two tools in one zone pull it apart", 1,
     kNoRest, Disagrees},
    {"lid_on_kept_volume", "tools", "lid_on_kept_volume", "constant volume, nothing of it free",
     0.8, GainsAtMost(1e-3), PressesHard},
    {"lost_poses", "tools", "lost_poses", "30 % of the poses lost, the rest late and reordered",
     1.2, kNoRest, Pulls, nullptr, LosePoses},
    // Contact.
    {"strength_zero", "contact", "strength_zero", "an adhesive that holds nothing", 1, kNoRest,
     LetsGo},
    {"strength_infinite", "contact", "strength_infinite", "an adhesive that holds 100 g", 1,
     kNoRest, HoldsForEver},
    {"chatter", "contact", "chatter", "loaded to 0.9, 1 and 1.1 of the strength", 2, kNoRest,
     DoesNotChatter},
    {"zone_of_one", "contact", "zone_of_one", "a zone of one particle", 1.2, kNoRest, ZoneOfOne},
    {"zone_of_two", "contact", "zone_of_two", "a zone of two particles", 1, kNoRest, ZoneOfTwo},
    {"zone_collinear", "contact", "zone_collinear", "a zone of particles on a line", 1.2, kNoRest,
     Pulls},
    {"zone_coplanar", "contact", "zone_coplanar", "a zone of particles in a plane", 1.2, kNoRest,
     Pulls},
    {"three_bodies", "contact", "../paper/zone_of_three", "three bodies in one zone", 2, kNoRest,
     ZoneOfThree},
    {"sandwich", "contact", "sandwich", "a sheet stuck on both sides", 1, kNoRest, ZoneOfThree},
    {"claimed_twice", "contact", "sandwich_in_patches", "particles claimed by two zones", 1,
     kNoRest, ZonesOfPatches},
    {"merges_1000", "contact", "merges_1000", "1,024 zones become one in a step", 0.05, kNoRest,
     Merges, nullptr, nullptr, AddCubes, nullptr, true},
    {"overlap_tissue", "contact", "overlap_tissue", "two blocks half in each other", 2, kNoRest,
     Overlaps},
    {"overlap_cells", "contact", "overlap_cells", "two cells nearly in the same place", 2, kNoRest,
     Overlaps},
    {"stack_of_ten", "contact", "stack_of_ten", "ten cubes on each other", 1, kNoRest, Stands},
    {"friction_holds", "contact", "friction_holds", "slope of 0.5, coefficient 0.51", 1, kNoRest,
     Stays},
    {"friction_slides", "contact", "friction_slides", "slope of 0.5, coefficient 0.49", 1, kNoRest,
     Slides},
    {"thrown_on_stiff_slab", "contact", "thrown_on_stiff_slab", "a ball slides on 1 MPa", 0.5,
     GainsAtMost(2.6e-5), Touches},
    {"turns_about_stuck_corner", "contact", "turns_about_stuck_corner", "7 MPa stuck by a corner",
     1, GainsAtMost(3e-6), Touches},
    {"ball_on_mat", "contact", "ball_on_mat", "a stiff ball on a thin mat", 0.5, kNoRest, Touches},
    {"pin_cushion", "contact", "pin_cushion", "a soft ball on 25 points", 0.6, kNoRest, Touches},
    {"spike_on_spike", "contact", "spike_on_spike", "point on point", 0.6, kNoRest, Touches},
    {"spike_in_crack", "contact", "spike_in_crack", "a point between two edges", 0.6, kNoRest,
     Touches},
    {"chain_of_ten", "contact", "chain_of_ten", "a chain of ten links", 1, kNoRest, Stands},
    {"arch", "contact", "arch", "nine stones of an arch, nothing sticks", 1, kNoRest, Stays},
    {"card_house", "contact", "card_house", "cards that lean on each other", 1, kNoRest, Stays},
    {"tight_fit", "contact", "tight_fit", "a cube in a hole 0.6 mm wider", 1, kNoRest, IsThrough},
    {"funnel", "contact", "funnel", "tissue through a slot of 0.6 of its width", 1, RestBy(0.8),
     IsThrough},
    {"four_rods", "contact", "four_rods", "four rods twist into a bundle", 1, kNoRest, Touches},
    {"compactor", "contact", "compactor", "three bodies under a plate of 8 kg", 1, kNoRest,
     Touches},
    {"aggregate_2500", "contact", "aggregate_2500", "2,500 cells", 0.5, kNoRest, Touches, nullptr,
     nullptr, nullptr, nullptr, true},
    {"hour", "contact", "hour", "an hour at 1 kHz", 3600, kNoRest, DoesNotCreep, nullptr, nullptr,
     nullptr, nullptr, true},
    {"sheet_between_tool_and_block", "tools", "sheet_between_tool_and_block",
     "a held sheet pressed onto a block, with friction", 0.3, kNoRest, nullptr, nullptr, nullptr,
     nullptr, nullptr, true, "force on a tool beyond what it can exert"},
    {"hinged_plate_on_10_mg", "tools", "hinged_plate_on_10_mg", "a tool of 10 mg gives way", 0.5,
     kNoRest, nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"stopped_by_many_points", "tools", "stopped_by_many_points", "a tool wedged at 60 Hz", 1.5,
     kNoRest, nullptr, nullptr, nullptr, nullptr, nullptr, true,
     "the tool's axis passes through a triangle"},
    // Torture: random scenes that failed once.
    {"torture_4", "torture", "torture_4", "needle, pinned sheet and ball in one zone", 2, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_9", "torture", "torture_9", "blocks of a millimetre and 4 MPa at 100 Hz", 2, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_12", "torture", "torture_12", "bodies that overlap at the start", 2, kNoRest, nullptr,
     nullptr, nullptr, nullptr, nullptr, true},
    {"torture_39", "torture", "torture_39", "lancet and pins in one zone", 2, kNoRest, nullptr,
     nullptr, nullptr, nullptr, nullptr, true},
    {"torture_43", "torture", "torture_43", "a weak tool and a sheet at 60 Hz", 2, kNoRest, nullptr,
     nullptr, nullptr, nullptr, nullptr, true},
    {"torture_49", "torture", "torture_49", "fast tool on soft tissue at 100 Hz", 2, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_71", "torture", "torture_71", "a ball of 7 MPa that spins, at 200 Hz", 2, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_220", "torture", "torture_220", "tissue that one tool drives into another", 2,
     kNoRest, nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_367", "torture", "torture_367", "a body three times as fast as the tool may be", 0.4,
     kNoRest, nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_525", "torture", "torture_525", "thin zones that spin at 60 Hz", 1.2, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_763", "torture", "torture_763", "two needles, a sheet and a heavy block", 0.8,
     kNoRest, nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_959", "torture", "torture_959", "two needles among five bodies", 0.4, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_1532", "torture", "torture_1532", "light shells of volume and a tool", 0.4, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_1543", "torture", "torture_1543", "an undamped sheet beside 7 MPa", 0.8, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_1586", "torture", "torture_1586", "tissue of 90 kPa and a tool", 2, kNoRest, nullptr,
     nullptr, nullptr, nullptr, nullptr, true},
    {"torture_1677", "torture", "torture_1677", "patches that slide, at 2 kHz", 0.3, kNoRest,
     nullptr, nullptr, nullptr, nullptr, nullptr, true},
    {"torture_1678", "torture", "torture_1678", "tools at their limit", 2, kNoRest, nullptr,
     nullptr, nullptr, nullptr, nullptr, true},
};

}  // namespace

std::span<const StressCase> StressCases() { return kCases; }

}  // namespace adhesim
