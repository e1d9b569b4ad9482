#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/study/accuracy_study.h"
#include "core/study/accuracy_trace.h"

namespace adhesim {

// What references are made of, and the time that there is for them.
struct ReferenceRequest {
  const v1::Scene& scene;  // as written
  const std::string& directory;
  const Model& model;  // of it
  const AccuracyProbes& probes;
  const TraceOptions& trace;
  double run_s = 0;   // wall time of a run of the scene as it is
  double left_s = 0;  // of the study's budget
  bool quick = false;
  int threads = 1;
  std::function<bool()> stop = nullptr;
  std::function<void(const std::string&)> progress = nullptr;
};

// The runs that others are judged by. `trace` is empty when there was no time for one.
struct AccuracyReferences {
  AccuracyReference reference;
  AccuracyTrace trace;
  std::optional<AccuracyReference> second;
  AccuracyTrace second_trace;
  std::string share;  // code that both use
  std::optional<AccuracyReference> finer_mesh;
  AccuracyTrace finer_trace;
  std::vector<std::string> left_out;
};

// The reference is the same problem at much finer steps; the second reference, by another
// integrator:
//   no contact, tools, constraints: Runge and Kutta's method, and the scene's own integrator;
//   implicit tissue:                the engine's explicit path, and its Newton path; where there is
//                                   no time for the explicit one, Newton's at two steps;
//   explicit surfaces with contact: the explicit path at two steps (there is no other).
// Of two, the one of shorter steps is the reference.
AccuracyReferences MakeAccuracyReferences(const ReferenceRequest& request);

}  // namespace adhesim
