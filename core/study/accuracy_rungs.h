#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "adhesim/v1/scene.pb.h"
#include "core/engine/engine.h"
#include "core/study/accuracy_error.h"
#include "core/study/accuracy_trace.h"

namespace adhesim {

// What the governor gives up, and what that changes here. Parts of the tools' peak force and of the
// smallest body's size, the largest at any instant: as FidelityRung declares them.
struct AccuracyRung {
  std::string name;
  double declared_force = 0, declared_position = 0;
  int point = -1;  // of the study, with it and all before it given up
  // Absent where that did not run, and where no tool feels a force.
  std::optional<double> force, position;
};

// An engine's rungs, not measured yet.
std::vector<AccuracyRung> RungsOf(const Engine& engine);

// Measured by a run with it and all before it given up, and the same run in full.
void JudgeRung(const AccuracyTrace& lowered, const AccuracyTrace& full, const Model& model,
               AccuracyRung* rung);

// An engine's rungs, each measured by a run. Those that time ran out for are as RungsOf() has them.
// Leaves the engine at full fidelity.
std::vector<AccuracyRung> MeasureRungs(Engine* engine, const AccuracyProbes& probes,
                                       const TraceOptions& options, const AccuracyTrace& full);

// As a scene holds them, each number rounded up to two digits. Errors (FailedPrecondition): one
// that was not measured, or cannot be declared.
absl::StatusOr<v1::Rungs> RungsMessage(std::span<const AccuracyRung> rungs, bool has_tools);

}  // namespace adhesim
