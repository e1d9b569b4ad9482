#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/engine/engine.h"

namespace adhesim {

// What is seen of a scene at one time.
struct StudySample {
  double time_s = 0;
  double cpu_ms = 0;  // of a step: median since the sample before; 0 at the start
  int colliding_particles = 0;
  int zones = 0;
  double energy_j = 0;         // kinetic and elastic
  double permitted_j = 0;      // what was put in: initial energy, work of fields and tools, pushing
  double contact_added_j = 0;  // by contact, in every step where it did not take (see below)
  double captured_j = 0, viscous_j = 0;
  double slid_j = 0;    // lost to sliding
  double pushed_j = 0;  // gained by pushing apart bodies that lie in each other at the start
  // Without the potential of contact effects, where the scene has such (BodiesEnergy).
  std::optional<double> bodies_energy_j;
  double radius_m = 0;                 // of gyration, about the centre of mass
  std::optional<double> separation_m;  // between the centres of the first two bodies
  int group_bodies = 0;                // in the largest group of bodies that hold each other
  int zone_bodies = 0;                 // in the zone that holds the most
  // Of the followed body's centre, since the start.
  std::optional<double> moved_m, speed_m_s;
  // Of the rolling body since the start.
  std::optional<double> revolutions, rolled_m, travel_m, slip_m;
  std::optional<double> mean_gap_m;  // of the pairs that hold each other now
  std::optional<double> volume_error;
  // Sampled more rarely in large scenes, and only where a body is closed.
  std::optional<double> max_depth_m;
  std::optional<int> vertices_inside;
};

// What is told of an instant of which a picture is taken.
struct StudyInstant {
  double time_s = 0;
  int colliding_particles = 0;
};

// A scene's run from its start.
struct PaperStudy {
  int bodies = 0, particles = 0, triangles = 0;
  double dt_s = 0;
  std::uint64_t steps = 0;
  bool finite = true, interrupted = false;
  std::uint32_t report_bits = 0;  // StepBit of any step
  std::optional<double> capture_distance_m, release_distance_m;
  std::optional<double> smallest_radius_m;   // of a closed body: from its middle to its furthest
                                             // particle
  double cpu_ms_median = 0, cpu_ms_p99 = 0;  // of the steps of the second half
  double second_half_colliding = 0;          // mean number of colliding particles in it
  double reference_j = 0;                    // E_ref at the end
  double identity_error = 0;                 // of the ledger
  double momentum_linear = 0, momentum_angular = 0;  // largest errors of the balances, relative
  std::vector<StudyInstant> instants;                // that the run reached
  std::vector<StudySample> samples;                  // the first at the start, the last at the end
};

struct StudyOptions {
  double duration_s = 1;
  int samples = 200;                           // after the start
  std::string rolling_body;                    // see RollingMeter; empty, or no closed body: none
  std::string followed_body;                   // whose centre is followed; empty: none
  std::vector<double> instants;                // fractions of the duration, ascending
  std::function<void()> at_instant = nullptr;  // when the engine is there; its time is nobody's
  std::function<bool()> stop = nullptr;
};

// Runs an engine that is at its start, on the calling thread, until the end, a non-finite state, or
// `stop`. What contact added is the sum over steps of what it gained where it may only lose: less
// captured_j than before (an orthogonal projection takes energy, physics notes 3.2), work of
// sliding contacts above 0, rotation of zones. Gains of one step are not set off against losses of
// another. Pushing apart bodies that lie in each other at the start is no work of contact: it is
// booked as correction and told beside it (`pushed_j`).
PaperStudy RunPaperStudy(Engine* engine, const StudyOptions& options);

// Most energy of a sample above what was put in, over E_ref; 0 where nothing had energy.
double EnergyExcess(const PaperStudy& study);
// The same of the bodies without the potential of contact effects.
double BodiesExcess(const PaperStudy& study);

}  // namespace adhesim
