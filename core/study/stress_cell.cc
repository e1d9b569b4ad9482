#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>

#include "core/scene/build_model.h"
#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "core/study/stress_cases.h"

namespace adhesim {
namespace {

constexpr std::uint32_t kMostSubsteps = 500;  // an explicit step that needs more may be refused

// How messages of Engine::Create about explicit steps begin and what they name.
bool NeedsTooManySubsteps(const std::string& message) {
  return absl::StrContains(message, "sub-steps to be stable");
}

bool HasTissue(const v1::Scene& scene) {
  return std::any_of(scene.effects().begin(), scene.effects().end(),
                     [](const v1::Effect& e) { return e.has_elasticity(); });
}

void Apply(const StressVariant& variant, v1::Scene* scene) {
  if (!variant.dt_s) return;
  scene->set_rate_hz(1 / *variant.dt_s);
  scene->clear_rungs();
  v1::Integration* integration = scene->mutable_integration();
  integration->set_max_substeps(kMostSubsteps);
  if (variant.integrator != v1::INTEGRATOR_UNSPECIFIED) {
    integration->set_integrator(variant.integrator);
  }
  for (v1::Effect& effect : *scene->mutable_effects()) {
    if (!effect.has_elasticity() || variant.model == v1::ELASTIC_MODEL_UNSPECIFIED) continue;
    effect.mutable_elasticity()->set_model(variant.model);
  }
}

std::string Messages(const Problems& problems) {
  std::vector<std::string> messages;
  for (const Problem& problem : problems) {
    if (!problem.warning) messages.push_back(absl::StrCat(problem.path, ": ", problem.message));
  }
  return absl::StrJoin(messages, "; ");
}

// An engine at its start, or the message with which it is refused.
absl::StatusOr<std::unique_ptr<Engine>> Load(const StressCase& stress_case,
                                             const StressVariant& variant, SceneFile file) {
  if (!file.ok()) return absl::InvalidArgumentError(Messages(file.problems));
  if (stress_case.extend != nullptr) stress_case.extend(&file.scene);
  Apply(variant, &file.scene);
  if (const Problems problems = ValidateScene(file.scene); !AllWarnings(problems)) {
    return absl::InvalidArgumentError(Messages(problems));
  }
  const BuiltModel built = BuildModel(WithDefaults(file.scene), file.directory);
  if (built.model == nullptr) return absl::InvalidArgumentError(Messages(built.problems));
  return Engine::Create(built.model, Engine::Options());
}

StressResult Refusal(const StressCase& stress_case, const std::string& message) {
  StressResult result;
  result.cause = message;
  const bool declared =
      stress_case.refused != nullptr && absl::StrContains(message, stress_case.refused);
  if (declared || NeedsTooManySubsteps(message)) result.outcome = StressOutcome::kRefused;
  return result;
}

StressResult RunVariant(const StressCase& stress_case, const StressVariant& variant, SceneFile file,
                        double cpu_limit_s, const std::function<bool()>& stop) {
  absl::StatusOr<std::unique_ptr<Engine>> engine = Load(stress_case, variant, std::move(file));
  if (!engine.ok()) return Refusal(stress_case, std::string(engine.status().message()));
  StressResult result;
  if (stress_case.refused != nullptr) {
    result.cause = absl::StrCat("was to be refused: ", stress_case.refused);
    return result;
  }
  if (stress_case.spoil != nullptr) StartFrom(stress_case.spoil, engine->get());
  StressRun run;
  run.duration_s = stress_case.duration_s;
  run.drive = stress_case.drive;
  run.cpu_limit_s = cpu_limit_s;
  run.stop = stop;
  result.figures = RunStress(engine->get(), run);
  result.interrupted = result.figures.interrupted;
  if (!result.figures.frozen_because.empty()) {
    result.outcome = StressOutcome::kFrozen;
    result.cause = result.figures.frozen_because;
    return result;
  }
  std::vector<std::string> failures = WhatFails(stress_case.conditions, result.figures);
  if (failures.empty() && stress_case.shows != nullptr) {
    if (const char* lacks = stress_case.shows(result.figures)) failures.push_back(lacks);
  }
  result.cause = absl::StrJoin(failures, "; ");
  if (failures.empty()) result.outcome = StressOutcome::kSurvived;
  return result;
}

}  // namespace

std::string VariantName(const StressVariant& variant) {
  if (!variant.dt_s) return "default";
  std::string name = absl::StrFormat("%.3g ms", 1e3 * *variant.dt_s);
  switch (variant.integrator) {
    case v1::INTEGRATOR_EXPLICIT:
      absl::StrAppend(&name, " explicit");
      break;
    case v1::INTEGRATOR_IMPLICIT:
      absl::StrAppend(&name, " implicit");
      break;
    case v1::INTEGRATOR_NEWTON:
      absl::StrAppend(&name, " newton");
      break;
    default:
      break;
  }
  if (variant.model == v1::ELASTIC_MODEL_COROTATIONAL) absl::StrAppend(&name, " corotational");
  if (variant.model == v1::ELASTIC_MODEL_NEO_HOOKEAN) absl::StrAppend(&name, " neo-Hookean");
  return name;
}

std::vector<StressVariant> StressMatrix(const StressCase& stress_case, const v1::Scene& scene) {
  if (stress_case.one_setting || stress_case.refused != nullptr) return {};
  std::vector<StressVariant> variants;
  const double steps_s[] = {0.001, 0.005, 1.0 / 60, 0.05};
  if (!HasTissue(scene)) {
    for (const double dt_s : steps_s) variants.push_back({dt_s, v1::INTEGRATOR_EXPLICIT});
    return variants;
  }
  for (const v1::ElasticModel model :
       {v1::ELASTIC_MODEL_COROTATIONAL, v1::ELASTIC_MODEL_NEO_HOOKEAN}) {
    for (const v1::Integrator integrator :
         {v1::INTEGRATOR_EXPLICIT, v1::INTEGRATOR_IMPLICIT, v1::INTEGRATOR_NEWTON}) {
      for (const double dt_s : steps_s) variants.push_back({dt_s, integrator, model});
    }
  }
  return variants;
}

const char* OutcomeName(StressOutcome outcome) {
  switch (outcome) {
    case StressOutcome::kSurvived:
      return "survived";
    case StressOutcome::kRefused:
      return "refused";
    case StressOutcome::kFrozen:
      return "frozen";
    case StressOutcome::kFailed:
      return "failed";
  }
  return "";
}

StressResult RunStressCase(const StressCase& stress_case, const StressVariant& variant,
                           const std::string& scenes_directory, double cpu_limit_s,
                           const std::function<bool()>& stop) {
  const std::string path = absl::StrCat(scenes_directory, "/", stress_case.scene, ".yaml");
  return RunVariant(stress_case, variant, ReadSceneFile(path), cpu_limit_s, stop);
}

StressResult RunStressScene(const StressCase& stress_case, SceneFile file, double cpu_limit_s,
                            const std::function<bool()>& stop) {
  return RunVariant(stress_case, StressVariant(), std::move(file), cpu_limit_s, stop);
}

}  // namespace adhesim
