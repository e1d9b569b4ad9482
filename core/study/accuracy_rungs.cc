#include "core/study/accuracy_rungs.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace adhesim {
namespace {

// To two digits, so that what is declared is never less than what was seen.
double RoundedUp(double part) {
  if (!(part > 0)) return 0;
  const double unit = std::pow(10, std::floor(std::log10(part)) - 1);
  double rounded = 0;
  // By way of its text: digits times a power of ten is not the number that reads so.
  return absl::SimpleAtod(absl::StrFormat("%.2g", std::ceil(part / unit) * unit), &rounded)
             ? rounded
             : part;
}

}  // namespace

std::vector<AccuracyRung> RungsOf(const Engine& engine) {
  std::vector<AccuracyRung> rungs;
  for (const FidelityRung& rung : engine.rungs()) {
    rungs.push_back({rung.name, rung.force_error, rung.position_error, -1, {}, {}});
  }
  return rungs;
}

void JudgeRung(const AccuracyTrace& lowered, const AccuracyTrace& full, const Model& model,
               AccuracyRung* rung) {
  double size_m = std::numeric_limits<double>::infinity();
  for (const Body& body : model.bodies) {
    if (!body.all_fixed) size_m = std::min(size_m, body.size_m);
  }
  const AccuracyError error = Compare(lowered, full);
  rung->position = error.position_m.linf / size_m;
  const double peak_n = PeakForce(full);
  if (error.force_n && peak_n > 0) rung->force = error.force_n->linf / peak_n;
}

std::vector<AccuracyRung> MeasureRungs(Engine* engine, const AccuracyProbes& probes,
                                       const TraceOptions& options, const AccuracyTrace& full) {
  std::vector<AccuracyRung> rungs = RungsOf(*engine);
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    engine->SetFidelity(static_cast<int>(r) + 1);
    const AccuracyTrace lowered = RunTrace(engine, probes, options, nullptr);
    if (lowered.left_out || !lowered.failed.empty()) break;
    JudgeRung(lowered, full, engine->model(), &rungs[r]);
  }
  engine->SetFidelity(0);
  return rungs;
}

absl::StatusOr<v1::Rungs> RungsMessage(std::span<const AccuracyRung> rungs, bool has_tools) {
  v1::Rungs message;
  for (const AccuracyRung& rung : rungs) {
    if (!rung.position) {
      return absl::FailedPreconditionError(
          absl::StrCat("what giving up ", rung.name, " costs was not measured in the time"));
    }
    if (has_tools && !rung.force) {
      return absl::FailedPreconditionError("no tool feels a force in the time that is studied");
    }
    const double force = RoundedUp(rung.force.value_or(0)), position = RoundedUp(*rung.position);
    if (force > 1 || position > 1) {
      return absl::FailedPreconditionError(
          absl::StrCat("with ", rung.name, " given up, runs part by more than the ",
                       force > 1 ? "peak force" : "size of a body"));
    }
    const auto* field = v1::Rungs::descriptor()->FindFieldByName(rung.name);
    auto* error =
        static_cast<v1::RungError*>(message.GetReflection()->MutableMessage(&message, field));
    if (has_tools) error->set_force_error(force);
    error->set_position_error(position);
  }
  return message;
}

}  // namespace adhesim
