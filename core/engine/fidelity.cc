// What the pipeline can do without for a while (docs/governor.md).

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "core/engine/pipeline.h"
#include "core/model/rungs.h"

namespace adhesim {
namespace {

constexpr char kIterations[] = "iterations", kDetection[] = "detection", kStiffness[] = "stiffness";

// Iterations: the implicit solver's tolerance grows so many times, but not above the greatest; with
// that, forces on tools stay within 5 % of their peak (measured: docs/governor.md).
constexpr double kLooser = 5;
constexpr double kLoosest = 0.02;
constexpr int kNewtonIterations = 3;
// Volumes are met to this part, where round-off is 1e-15: the error is of each step, and does not
// add up.
constexpr double kVolumeTolerance = 1e-6;
constexpr int kStiffnessEvery = 2;  // sub-steps, of which the first assembles

}  // namespace

absl::Status Pipeline::CompileRungs() {
  // Most that was measured (docs/governor.md), rounded up; the first rung makes nearly all of it.
  const double force_error = implicit_ ? 0.05 : 0.005;
  const double position_error = implicit_ ? 0.006 : 1e-6;
  const auto add = [&](const char* name) { rungs_.push_back({name, force_error, position_error}); };
  const bool rows = std::any_of(effects_.begin(), effects_.end(),
                                [](const auto& effect) { return !effect->constraints().empty(); });
  if (rows || (implicit_ && model_->tolerance < kLoosest)) {
    add(kIterations);
  }
  // Forces that feel what is near, and contacts that slide, need it as it is now.
  const bool feels = std::any_of(effects_.begin(), effects_.end(),
                                 [](const auto& effect) { return effect->contact_reach_m() > 0; });
  if (adhesive_ && !feels && !model_->adhesive->friction_coefficient) {
    add(kDetection);
  }
  if (implicit_ && model_->integrator == Integrator::kImplicit) {
    add(kStiffness);
  }
  absl::Status status;
  ForEachRung(model_->scene.rungs(), [&](const std::string& name, const v1::RungError& error) {
    const auto rung = std::find_if(rungs_.begin(), rungs_.end(),
                                   [&name](const FidelityRung& one) { return name == one.name; });
    if (rung != rungs_.end()) {
      *rung = {rung->name, error.force_error(), error.position_error(), true};
      return;
    }
    const auto append_name = [](std::string* out, const FidelityRung& one) { *out += one.name; };
    status.Update(absl::InvalidArgumentError(
        absl::StrCat("rungs.", name, ": the scene has no such rung to give up; permitted: ",
                     rungs_.empty() ? "none" : absl::StrJoin(rungs_, ", ", append_name))));
  });
  return status;
}

void Pipeline::SetFidelity(int rungs) {
  fidelity_ = std::clamp(rungs, 0, static_cast<int>(rungs_.size()));
  const auto lowered = [this](std::string_view name) {
    return std::any_of(rungs_.begin(), rungs_.begin() + fidelity_,
                       [name](const FidelityRung& rung) { return rung.name == name; });
  };
  search_in_turns_ = lowered(kDetection);
  if (lowered(kIterations)) {
    solver_->SetConstraintTolerance(kVolumeTolerance);
  } else {
    solver_->SetConstraintTolerance(SubspaceSolver::kConstraintTolerance);
  }
  if (!implicit_) return;
  ImplicitSolver::Effort effort = implicit_->FullEffort();
  if (lowered(kIterations)) {
    effort.tolerance = std::max(model_->tolerance, std::min(kLooser * model_->tolerance, kLoosest));
    effort.newton_iterations = kNewtonIterations;
  }
  if (lowered(kStiffness)) effort.stiffness_every = kStiffnessEvery;
  implicit_->SetEffort(effort);
}

// In turns where two sub-steps bring nothing further than one may without it: then what is listed
// is all that could be crossed, as ever. Tools are looked for in every sub-step.
Pipeline::Search Pipeline::NextSearch() {
  const bool turns = search_in_turns_ && slow_ && searched_ && !state_.contacts.overlapping;
  searched_ = slow_;
  old_lists_ = turns;
  if (!turns) return {true, true};
  edges_next_ = !edges_next_;
  return {!edges_next_, edges_next_};
}

}  // namespace adhesim
