#include "clients/cli/run_report.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <numeric>

#include "core/model/effect_name.h"
#include "core/model/simd.h"
#include "core/scene/field_options.h"

namespace adhesim {
namespace {

Json ToJson(const Distribution& d) {
  return {{"min", d.min}, {"median", d.median}, {"p99", d.p99}, {"max", d.max}};
}

Json ToJson(const CountStatistics& count) {
  return {{"mean", count.mean()}, {"max", count.max}, {"final", count.final}};
}

Json ToJson(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

// What the engine met and could not do fully, in words.
std::vector<std::string> ReportNames(std::uint32_t bits) {
  static constexpr std::pair<StepBit, const char*> kNames[] = {
      {kStepNonFinite, "non_finite"},
      {kStepBondCapacity, "bond_capacity"},
      {kStepReleasePasses, "releases_put_off"},
      {kStepVolumeNotMet, "volume_not_met"},
      {kStepSubstepLimit, "substep_limit"},
      {kStepZoneSplitForced, "zone_split_forced"},
      {kStepCandidateCapacity, "candidate_capacity"},
      {kStepOverlap, "overlap"},
      {kStepNotConverged, "not_converged"}};
  std::vector<std::string> names;
  for (const auto& [bit, name] : kNames) {
    if (bits & bit) names.push_back(name);
  }
  return names;
}

Json EnergyJson(const Engine& engine) {
  const Ledger& ledger = engine.state().ledger;
  return {{"initial_j", ledger.initial_j},
          {"final_j", engine.MechanicalEnergy()},
          {"reference_j", EnergyReference(ledger)},
          {"external_work_j", ledger.external_work_j},
          {"tool_work_j", ledger.tool_work_j},
          {"captured_j", ledger.captured_j},
          {"viscous_j", ledger.viscous_j},
          {"rotation_j", ledger.rotation_j},
          {"numerical_j", ledger.numerical_j},
          {"correction_j", ledger.correction_j},
          {"volume_j", ledger.volume_j},
          {"sliding_j", ledger.sliding_j},
          {"tie_j", ledger.tie_j},
          {"identity_error", IdentityError(ledger)}};
}

Json ToolsJson(const Engine& engine, const RunStatistics& statistics) {
  Json tools = Json::array();
  for (std::size_t i = 0; i < engine.model().tools.size(); ++i) {
    const Wrench& tissue = engine.state().tools[i].tissue;
    tools.push_back({{"name", engine.model().tools[i].name},
                     {"peak_force_n", statistics.peak_force_n[i]},
                     {"final_force_n", ToJson(tissue.force_n)},
                     {"final_torque_nm", ToJson(tissue.torque_nm)}});
    if (const double error = statistics.force_error_n[i]; error >= 0)
      tools.back()["force_error_n"] = error;
  }
  return tools;
}

// Names of the scene's effects, in its order.
Json EffectsJson(const v1::Scene& scene) {
  Json names = Json::array();
  for (const v1::Effect& effect : scene.effects()) names.push_back(EffectName(effect));
  return names;
}

void AddTimes(const Engine& engine, const RunOptions& options, const RunStatistics& statistics,
              Json* report) {
  if (statistics.wall_ms.empty()) return;
  (*report)["wall_ms_per_step"] = ToJson(Describe(statistics.wall_ms));
  (*report)["cpu_ms_per_step"] = ToJson(Describe(statistics.cpu_ms));
  // Of stepping alone: neither waiting for deadlines nor measuring is in it.
  const double simulated_s = static_cast<double>(statistics.wall_ms.size()) * engine.model().dt_s;
  const double wall_s =
      1e-3 * std::accumulate(statistics.wall_ms.begin(), statistics.wall_ms.end(), 0.0);
  (*report)["realtime_factor"] = simulated_s / wall_s;
  if (options.realtime) (*report)["deadline_misses"] = statistics.deadline_misses;
  if (options.step_budget_s > 0) {
    Json rungs = Json::array();
    for (const FidelityRung& rung : engine.rungs()) rungs.push_back(rung.name);
    (*report)["fidelity"] = {{"step_budget_s", options.step_budget_s},
                             {"changes", statistics.fidelity_changes},
                             {"rungs", rungs},
                             {"steps_without", statistics.steps_without}};
  }
  (*report)["stages"] = StagesJson(engine);
}

std::string Number(const Json& value) { return absl::StrFormat("%.4g", value.get<double>()); }

std::string TimesText(const Json& report) {
  if (!report.contains("wall_ms_per_step")) return "";
  const Json& wall = report["wall_ms_per_step"];
  std::string text = absl::StrCat("step      ", Number(wall["median"]), " ms median, ",
                                  Number(wall["p99"]), " ms p99, ", Number(wall["max"]),
                                  " ms max; ", Number(report["realtime_factor"]), " x real time\n");
  if (report.contains("deadline_misses")) {
    absl::StrAppend(&text, "deadlines ", report["deadline_misses"].get<std::int64_t>(),
                    " missed\n");
  }
  if (report.contains("fidelity")) {
    const Json& steps = report["fidelity"]["steps_without"];
    absl::StrAppend(&text, "fidelity  ", steps[0].get<std::uint64_t>(), " steps in full");
    for (std::size_t rung = 1; rung < steps.size(); ++rung) {
      absl::StrAppend(&text, ", ", steps[rung].get<std::uint64_t>(), " with ", rung,
                      " rungs given up");
    }
    absl::StrAppend(&text, "\n");
  }
  for (const Json& stage : report["stages"]) {
    absl::StrAppend(
        &text,
        absl::StrFormat("  %-24s %9.1f us %5.1f %%\n", stage["name"].get<std::string>(),
                        stage["median_us"].get<double>(), 100 * stage["share"].get<double>()));
  }
  return text;
}

}  // namespace

Json StagesJson(const Engine& engine) {
  double sum = 0;
  std::vector<double> medians;
  for (const Engine::Stage& stage : engine.stages()) {
    medians.push_back(stage.us.empty() ? 0 : Describe(stage.us).median);
    sum += medians.back();
  }
  Json stages = Json::array();
  for (std::size_t i = 0; i < medians.size(); ++i) {
    stages.push_back({{"name", engine.stages()[i].name},
                      {"median_us", medians[i]},
                      {"share", sum > 0 ? medians[i] / sum : 0},
                      {"reason", engine.stages()[i].reason}});
  }
  return stages;
}

Json RunReportJson(const Engine& engine, const RunOptions& options, const RunStatistics& statistics,
                   int threads) {
  const Model& model = engine.model();
  Json report = {{"scene", model.name},
                 {"steps", statistics.steps},
                 {"dt_s", model.dt_s},
                 {"substeps", engine.substeps()},
                 {"threads", threads},
                 {"simd", SimdTarget()},
                 {"bodies", model.bodies.size()},
                 {"particles", model.particle_count()},
                 {"triangles", model.triangles.size()},
                 {"finite", !engine.frozen()},
                 {"sleeping", model.sleep.has_value()}};  // false: figures are of all bodies
  if (model.sleep) report["bodies_asleep"] = engine.state().sleep.bodies;
  if (engine.frozen()) report["frozen_because"] = engine.FrozenBecause();
  if (!model.tetrahedra.empty()) report["tetrahedra"] = model.tetrahedra.size();
  if (statistics.interrupted) report["interrupted"] = true;
  AddTimes(engine, options, statistics, &report);
  if (model.adhesive || !model.tools.empty()) {
    report["colliding_particles"] = ToJson(statistics.colliding_particles);
    report["zones"] = ToJson(statistics.zones);
  }
  if (statistics.penetration) {
    report["max_depth_m"] = statistics.penetration->max_depth_m;
    report["vertices_inside_max"] = statistics.penetration->vertices_inside;
  }
  if (statistics.volume_error_max) report["volume_error_max"] = *statistics.volume_error_max;
  report["energy"] = EnergyJson(engine);
  const MomentumLedger& scale = engine.state().momentum;
  const auto relative = [](double imbalance, double of) { return of > 0 ? imbalance / of : 0; };
  report["report"] = ReportNames(statistics.report_bits);
  if (model.integrator != Integrator::kExplicit) {
    report["unconverged_steps"] = statistics.unconverged_steps;
  }
  report["momentum_error"] = {
      {"linear", relative(statistics.momentum_imbalance.linear, scale.scale_linear)},
      {"angular", relative(statistics.momentum_imbalance.angular, scale.scale_angular)}};
  if (!model.tools.empty()) report["tools"] = ToolsJson(engine, statistics);
  report["effects"] = EffectsJson(model.scene);
  report["state_hash"] = absl::StrFormat("%016x", engine.StateHash());
  return report;
}

std::string RunReportText(const Json& report) {
  std::string text =
      absl::StrCat(report["scene"].get<std::string>(), ": ", report["particles"].get<int>(),
                   " particles, ", report["triangles"].get<int>(), " triangles; ",
                   report["steps"].get<std::uint64_t>(), " steps of ", Number(report["dt_s"]),
                   " s (", report["substeps"].get<int>(), " sub-steps)\n", TimesText(report));
  if (report.contains("colliding_particles")) {
    const Json& particles = report["colliding_particles"];
    absl::StrAppend(&text, "contact   ", Number(particles["mean"]),
                    " colliding particles in the mean, ", particles["max"].get<int>(), " at most, ",
                    particles["final"].get<int>(), " at the end, in ",
                    report["zones"]["final"].get<int>(), " zones\n");
  }
  if (report.contains("max_depth_m")) {
    absl::StrAppend(&text, "overlap   ", Number(report["max_depth_m"]), " m at most, ",
                    report["vertices_inside_max"].get<int>(), " particles\n");
  }
  if (report.contains("tools")) {
    for (const Json& tool : report["tools"]) {
      absl::StrAppend(&text, "tool      ", tool["name"].get<std::string>(), ": peak force ",
                      Number(tool["peak_force_n"]), " N");
      if (tool.contains("force_error_n"))
        absl::StrAppend(&text, ", error bar at most ", Number(tool["force_error_n"]), " N");
      absl::StrAppend(&text, "\n");
    }
  }
  absl::StrAppend(&text, "energy    ", Number(report["energy"]["initial_j"]), " J at the start, ",
                  Number(report["energy"]["final_j"]), " J at the end; identity error ",
                  Number(report["energy"]["identity_error"]), "\n");
  for (const Json& name : report["report"]) {
    absl::StrAppend(&text, "report    ", name.get<std::string>(), "\n");
  }
  if (report.value("unconverged_steps", 0) > 0) {
    absl::StrAppend(&text, "solver    stopped at max_iterations in ",
                    report["unconverged_steps"].get<std::int64_t>(),
                    " steps: their forces err by more than the tolerance\n");
  }
  absl::StrAppend(&text, "momentum  error ", Number(report["momentum_error"]["linear"]),
                  " linear, ", Number(report["momentum_error"]["angular"]), " angular\n");
  if (report.contains("volume_error_max")) {
    absl::StrAppend(&text, "volume    error ", Number(report["volume_error_max"]), "\n");
  }
  absl::StrAppend(&text, "state     ", report["state_hash"].get<std::string>(), "\n");
  return text;
}

}  // namespace adhesim
