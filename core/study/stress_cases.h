#pragma once

#include <optional>
#include <span>
#include <string>

#include "adhesim/v1/scene.pb.h"
#include "core/scene/scene_file.h"
#include "core/study/stress_run.h"
#include "core/study/stress_starts.h"

namespace adhesim {

// A hard case: a scene of scenes/stress, what is done to it, and what must hold of it beside what
// always must (WhatFails).
struct StressCase {
  const char* name;
  const char* group;  // "shape", "contrast", "mesh", "tools", "contact" or "torture"
  const char* scene;  // file in scenes/stress, without ".yaml"
  const char* title;  // what is hard about it, in a few words
  double duration_s;  // simulated
  StressConditions conditions;
  // Every case shows that it is the case that it says to be: what it lacks, or null.
  const char* (*shows)(const StressFigures&) = nullptr;
  Spoil spoil = nullptr;
  Drive drive = nullptr;
  void (*extend)(v1::Scene* scene) = nullptr;  // bodies that would fill a file
  // Declared invalid: part of the message with which it is refused when it is loaded.
  const char* refused = nullptr;
  bool one_setting = false;  // too large or too long for the matrix
  // It fails at its own setting, and why: a finding that is not mended yet. It stays red.
  const char* open = nullptr;
};

// In the order in which they are reported.
std::span<const StressCase> StressCases();

// A cell of the matrix; what is absent is the scene's own.
struct StressVariant {
  std::optional<double> dt_s;
  v1::Integrator integrator = v1::INTEGRATOR_UNSPECIFIED;
  v1::ElasticModel model = v1::ELASTIC_MODEL_UNSPECIFIED;
};
// "5 ms explicit neo-Hookean"; "default".
std::string VariantName(const StressVariant& variant);
// dt 1, 5, 16.7 and 50 ms, times integrators and laws for tissue; surfaces have one of each. The
// default is not among them.
std::vector<StressVariant> StressMatrix(const StressCase& stress_case, const v1::Scene& scene);

enum class StressOutcome {
  kSurvived,  // every condition holds
  kRefused,   // when loaded, where that is permitted
  kFrozen,    // detected and named
  kFailed,    // anything else
};
const char* OutcomeName(StressOutcome outcome);

struct StressResult {
  StressOutcome outcome = StressOutcome::kFailed;
  std::string cause;  // of what is not survived
  StressFigures figures;
  bool interrupted = false;  // it has no outcome
};

// Loads the scene, changes it and runs it. Refusals are permitted of cases that are declared
// invalid, and of explicit steps that need more than 500 sub-steps.
StressResult RunStressCase(const StressCase& stress_case, const StressVariant& variant,
                           const std::string& scenes_directory, double cpu_limit_s,
                           const std::function<bool()>& stop = nullptr);
// The same of a scene at hand, at its own setting.
StressResult RunStressScene(const StressCase& stress_case, SceneFile file, double cpu_limit_s,
                            const std::function<bool()>& stop = nullptr);

}  // namespace adhesim
