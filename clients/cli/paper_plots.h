#pragma once

#include <vector>

#include "clients/cli/paper_report.h"
#include "clients/cli/svg_plot.h"

namespace adhesim {

// The curves of one figure: contact, cost, overlap, energy, and what its story needs. Values that
// are not finite are left out (a run that failed says so elsewhere).
std::vector<Plot> FigurePlots(const FigureReport& report);

// The methods of contact drawn over each other: energy above what was put in at the lowest and at
// the highest rate, that of the bodies alone, depth, and distance of the centres.
std::vector<Plot> RivalPlots(const std::vector<RivalResult>& results);

// Time of a step against the number of particles, over all figures that ran.
Plot CostPlot(const PaperReport& report);

}  // namespace adhesim
