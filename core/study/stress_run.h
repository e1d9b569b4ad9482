#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/engine/engine.h"

namespace adhesim {

// What a hard case must keep to. Energy, books, forces of tools and depth are always judged.
struct StressConditions {
  // Every deformable body has its shape at rest again by then, and keeps it (ShapeError below
  // 1 %, no tetrahedron inverted); absent: loads, contact or fields keep it from that.
  std::optional<double> rest_by_s;
  // Most energy above what was put in, J: E_ref grows with all that is exchanged, and a share of it
  // may be more than what a case has by itself. Absent: that share alone.
  std::optional<double> most_excess_j;
};

// What was seen of a run.
struct StressFigures {
  int particles = 0, substeps = 0;
  double dt_s = 0, simulated_s = 0, cpu_s = 0;
  std::uint64_t steps = 0;
  std::uint32_t bits = 0;  // StepBit of any step
  bool interrupted = false, out_of_time = false;
  std::string frozen_because;  // empty: it is not

  double energy_excess = 0;       // most above what was put in, over E_ref
  double excess_j = 0;            // the same in J
  double identity_error = 0;      // imbalance of a sub-step, over E_ref
  double adhesive_share = 0;      // gained by capture and zones' rotation, over E_ref
  double sliding_share = 0;       // gained by sliding, over E_ref, its losses not counted
  double slid_share = 0;          // the sum of sliding's work over E_ref
  double capture_distance_m = 0;  // 0: no adhesive
  double max_depth_m = 0, end_depth_m = 0;
  double overlap_m = 0;      // most while bodies that overlap at the start come apart
  int pierced = 0;           // most triangles that tools' axes passed through
  double peak_force_n = 0;   // tissue on a tool, mean of a step
  double coupling_over = 0;  // coupling's force over its limit, most
  double force_over = 0;     // tissue's force over what a tool can exert (see RunStress), most
  double end_shape_error = 0;
  int end_inverted = 0;
  double rest_since_s = 0;  // shape at rest from then on; infinite: not at the end

  int captures = 0, releases = 0;
  int most_zones = 0, most_zone_bodies = 0, most_zone_members = 0;
  int fewer_zones = 0;       // most zones that vanished in one step while something was captured
  double moved_m = 0;        // most that a particle is from where it started, at the end
  double drift_m = 0;        // most that it moved in the second half
  double fallen_m = 0;       // centre of mass, along -z
  double end_speed_m_s = 0;  // of the fastest particle, at the end
};

struct StressRun {
  double duration_s = 1;
  int samples = 100;  // of depth and shape; the end is one. Energy: every step
  // Inputs of a step; null: tools follow their trajectories.
  std::function<void(const Engine&, std::vector<ToolInput>*)> drive = nullptr;
  double cpu_limit_s = std::numeric_limits<double>::infinity();
  std::function<bool()> stop = nullptr;
};

// Runs an engine from where it is until the end, a non-finite state, the limit of time or `stop`.
//
// What bounds forces: a coupling's is at most max_force_n. Tissue's on the tool may be larger by
// what momentum the tool and the tissue that it carries lose in a step: at most
// 2 (m_tool + m_carried) max_speed_m_s / dt, and m_tool |dv| / dt for each change dv of the tool's
// velocity by a capture: a plastic impact, in which the tool gives no more than its own momentum. A
// body that hits a braced needle is caught and let go some dozens of times in a step until it
// stands.
StressFigures RunStress(Engine* engine, const StressRun& run);

// What does not hold, each in words with number and limit; empty: all does.
std::vector<std::string> WhatFails(const StressConditions& conditions,
                                   const StressFigures& figures);

}  // namespace adhesim
