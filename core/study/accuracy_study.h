#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/study/accuracy_advice.h"
#include "core/study/accuracy_error.h"
#include "core/study/accuracy_formula.h"
#include "core/study/accuracy_rungs.h"
#include "core/study/accuracy_settings.h"
#include "core/study/accuracy_trace.h"

namespace adhesim {

// Another engine that solves the scene's equations on its mesh, to be judged by the same reference.
struct AccuracyRival {
  AccuracyDial dial;  // its name and settings (of kRival), or why it cannot
  std::string about;  // what is the same in all of them: version, precision, solver
  // As RunTrace(), and repeatable.
  std::function<AccuracyTrace(const AccuracySetting& setting, const AccuracyProbes& probes,
                              const TraceOptions& options, AccuracyCost* cost)>
      run;
};

struct AccuracyOptions {
  double seconds = 0;  // simulated; 0: until the last trajectory ends, or 4 s
  int repeats = 3;     // of each setting, for its cost; interleaved
  bool quick = false;
  bool advised_rungs = false;  // measures the rungs at the cheapest setting too
  bool only_rungs = false;     // measures those of the scene as it is, and nothing else
  int threads = 1;
  double budget_s = 300;  // wall time of the whole study; what does not fit is left out, and named
  // Absent: 1 % of the motion, 2 % of the peak force, the scene's rate.
  std::optional<double> tolerance_m, tolerance_n, rate_hz;
  double step_share = 0.5;  // of a step's time for stepping
  // Of the scene's model; null: there is none.
  std::function<AccuracyRival(std::shared_ptr<const Model> model, const DialOptions& dials)> rival =
      nullptr;
  std::function<bool()> stop = nullptr;                        // the user has had enough
  std::function<void(const std::string&)> progress = nullptr;  // what is run now
};

// What a setting cost over its repeats.
struct CostFigures {
  int repeats = 0;
  // Time per simulated second.
  double wall_min = 0, wall_p50 = 0, wall_p99 = 0, cpu_min = 0;
  // Of a step's wall time, each the least of its repeats (which all do the same work).
  double step_p50_ms = 0, step_p99_ms = 0, step_max_ms = 0;
};

// A run that others are judged by.
struct AccuracyReference {
  std::string name;  // "explicit, 3200 Hz of 7 sub-steps"
  double rate_hz = 0;
  int substeps = 0;
  double wall = 0;  // s per simulated s
};

// One setting and what came of it.
struct AccuracyPoint {
  std::string dial;
  AccuracySetting setting;
  std::string failed;      // why it was refused, or where it ended; empty: it ran
  bool not_run = false;    // no time was left for it
  std::uint32_t bits = 0;  // StepBit of any step
  int substeps = 0;
  CostFigures cost;
  // Numerical settings and rivals against the reference; meshes against the finer mesh; laws and
  // zones against the scene as it is. Absent where there is none.
  std::optional<AccuracyError> error;
  std::optional<double> deflection_m;  // of a beam's end, at the end
};

// How fast the errors of a method fall with the step.
struct AccuracyOrder {
  std::string method;  // as in AccuracySetting
  FittedOrder fit;
  int points = 0;
};

struct AccuracyStudy {
  std::string scene;  // its name
  int bodies = 0, particles = 0, tetrahedra = 0, probes = 0;
  double duration_s = 0;
  std::size_t instants = 0;
  double rate_hz = 0;                     // the scene's own
  double motion_m = 0, peak_force_n = 0;  // of the reference: what tolerances are relative to
  AccuracyReference reference;
  std::optional<AccuracyReference> second;
  std::string references_share;       // code that both use
  std::optional<AccuracyError> band;  // of the second against the reference
  bool chaotic = false;               // they part: observables are judged
  std::optional<BeamFormula> formula;
  double reference_deflection_m = 0;  // with it
  std::optional<AccuracyReference> finer_mesh;
  std::optional<AccuracyError> own_mesh;  // the scene's own against the finer
  std::vector<AccuracyDial> dials;        // with their settings, tried or not; a rival's last
  std::string rival_about;                // as AccuracyRival::about; empty: there is none
  std::vector<AccuracyPoint> points;      // the first is the scene as it is
  std::vector<AccuracyOrder> orders;
  // In the order in which they are given up, of the scene as it is; and of the cheapest setting.
  std::vector<AccuracyRung> rungs, advised_rungs;
  AdviceLimits limits;
  Advice advice;  // indices into `points`
  std::vector<std::string> left_out;
};

// Runs a scene (as written; valid) at many settings and measures error and cost; of `only_rungs`
// there are no points but the scene as it is, no references and no advice. Errors:
// InvalidArgument for a scene that does not run as it is; DeadlineExceeded when the budget ends
// before there is a reference; Cancelled.
absl::StatusOr<AccuracyStudy> StudyAccuracy(const v1::Scene& scene, const std::string& directory,
                                            const AccuracyOptions& options);

}  // namespace adhesim
