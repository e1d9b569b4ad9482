#include "clients/cli/bullet_accuracy.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "clients/cli/bullet_tissue.h"

namespace adhesim {
namespace {

constexpr char kName[] = "Bullet";
constexpr int kStepsBetweenQuestions = 16;
// Over a step of ours of as many tetrahedra; an explicit sub-step is nearly half of that.
constexpr double kImplicitWork = 20, kExplicitWork = 3;

std::string WhyNotTheSame(const Model& model) {
  std::string why = BulletTissue::WhyNot(model);
  if (!why.empty() || !model.adhesive) return why;
  return "nothing sticks in it, and what touches is another problem";
}

AccuracySetting Setting(double rate_hz, bool implicit, int substeps, double own_rate_hz) {
  AccuracySetting setting;
  setting.kind = DialKind::kRival;
  setting.integrator = implicit ? Integrator::kImplicit : Integrator::kExplicit;
  setting.method = absl::StrCat(kName, ", ", IntegratorName(setting.integrator));
  setting.name = absl::StrFormat("%s, %.10g Hz", IntegratorName(setting.integrator), rate_hz);
  if (substeps > 1) {
    absl::StrAppend(&setting.method, " of ", substeps, " sub-steps");
    absl::StrAppend(&setting.name, " of ", substeps, " sub-steps");
  }
  setting.rate_hz = rate_hz;
  setting.substeps = substeps;
  setting.work = substeps * rate_hz / own_rate_hz * (implicit ? kImplicitWork : kExplicitWork);
  return setting;
}

AccuracyTrace Run(const Model& model, const AccuracySetting& setting, const AccuracyProbes& probes,
                  const TraceOptions& options, AccuracyCost* cost) {
  AccuracyTrace trace;
  trace.rate_hz = setting.rate_hz;
  trace.substeps = setting.substeps;
  const double dt_s = 1 / setting.rate_hz;
  BulletTissue bullet(model, dt_s, {setting.integrator == Integrator::kImplicit, setting.substeps});
  const AccuracyProbes::Places places = probes.On(model);
  std::vector<Vec3> position_m, velocity_m_s;
  StepTimes times;
  const std::int64_t steps = std::llround(options.instants_s.back() / dt_s);
  for (std::int64_t step = 1; step <= steps; ++step) {
    if (step % kStepsBetweenQuestions == 0 && options.out_of_time && options.out_of_time()) {
      trace.left_out = true;
      return trace;
    }
    TimeStep([&] { bullet.Step(); }, &times);
    const double instant_s = options.instants_s[trace.time_s.size()];
    if (step < std::llround(instant_s / dt_s)) continue;
    bullet.Read(&position_m, &velocity_m_s);
    AddInstant(model, places, instant_s, position_m, options, &trace);
    trace.force_n.emplace_back();  // it has no tools
    trace.colliding_share.push_back(0);
    trace.failed = WhatIsLost(model, places, trace);
    if (!trace.failed.empty()) return trace;
  }
  AddTo(times, cost);
  return trace;
}

}  // namespace

AccuracyRival BulletRival(std::shared_ptr<const Model> model, const DialOptions& options) {
  AccuracyRival rival;
  rival.dial.name = kName;
  if (const std::string why = WhyNotTheSame(*model); !why.empty()) {
    rival.dial.not_offered =
        absl::StrCat(BulletTissue::version(), " cannot express this scene: ", why);
    return rival;
  }
  rival.about = absl::StrCat(BulletTissue::version(), ": ", BulletTissue::settings_text());
  const double own_hz = 1 / model->dt_s;
  for (const double rate_hz : TriedRatesHz(*model, options)) {
    rival.dial.settings.push_back(Setting(rate_hz, true, 1, own_hz));
  }
  for (const int substeps : options.quick ? std::vector{1} : std::vector{1, 32, 64}) {
    rival.dial.settings.push_back(Setting(own_hz, false, substeps, own_hz));
  }
  rival.run = [model = std::move(model)](const AccuracySetting& setting,
                                         const AccuracyProbes& probes, const TraceOptions& trace,
                                         AccuracyCost* cost) {
    return Run(*model, setting, probes, trace, cost);
  };
  return rival;
}

}  // namespace adhesim
