#include "core/study/stress_run.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "core/study/contact_gain.h"
#include "core/study/shape_error.h"
#include "core/study/timing.h"
#include "core/tools/coupling.h"

namespace adhesim {
namespace {

constexpr double kEnergyShare = 0.01;     // of E_ref
constexpr double kIdentityShare = 1e-9;   // of E_ref
constexpr double kContactShare = 1e-9;    // of E_ref
constexpr double kRestShapeError = 0.01;  // strain
constexpr double kStillSpeedMS = 1e-9;    // slower than that is round-off
constexpr double kRounding = 1e-9;        // of a limit that the step itself clips to
// Depth and energy of 10 000 particles take longer than many steps: looked at in proportion more
// rarely.
constexpr int kParticlesSampledEachTime = 2000;

bool MayOverlap(const Model& model) {
  const auto closed = [](const Body& body) { return body.closed; };
  return model.bodies.size() > 1 && std::any_of(model.bodies.begin(), model.bodies.end(), closed);
}

double MeanHeight(const Model& model, const State& state) {
  double sum = 0, mass = 0;
  for (int p = 0; p < model.particle_count(); ++p) {
    if (model.fixed[p]) continue;
    sum += model.mass_kg[p] * state.position_m[p].z();
    mass += model.mass_kg[p];
  }
  return mass > 0 ? sum / mass : 0;
}

class Run {
 public:
  Run(Engine* engine, const StressRun& run)
      : engine_(*engine),
        model_(engine->model()),
        run_(run),
        start_m_(engine->state().position_m),
        half_m_(start_m_) {
    figures_.particles = model_.particle_count();
    figures_.substeps = engine->substeps();
    figures_.dt_s = model_.dt_s;
    if (model_.adhesive) figures_.capture_distance_m = model_.adhesive->capture_distance_m;
    may_overlap_ = MayOverlap(model_);
    start_height_m_ = MeanHeight(model_, engine->state());
    inputs_.resize(model_.tools.size());
    carried_kg_.assign(model_.tools.size(), 0);
  }

  StressFigures Go() {
    const std::int64_t steps =
        std::max<std::int64_t>(1, std::llround(run_.duration_s / model_.dt_s));
    const std::int64_t fewer = 1 + model_.particle_count() / kParticlesSampledEachTime;
    const std::int64_t samples = std::clamp<std::int64_t>(run_.samples / fewer, 1, steps);
    if (may_overlap_) {
      figures_.overlap_m = MeasurePenetration(model_, start_m_).max_depth_m;
    }
    std::int64_t sampled = 0;
    const double began_ms = ThreadCpuMs();
    for (std::int64_t step = 1; step <= steps; ++step) {
      Step();
      figures_.cpu_s = 1e-3 * (ThreadCpuMs() - began_ms);
      if (engine_.frozen()) break;
      if (step % fewer == 0) SampleEnergy();  // what comes and goes would be missed
      if (2 * step <= steps) half_m_ = engine_.state().position_m;
      if (step * samples >= (sampled + 1) * steps) {
        ++sampled;
        Sample();
      }
      figures_.interrupted = run_.stop && run_.stop();
      figures_.out_of_time = step < steps && figures_.cpu_s > run_.cpu_limit_s;
      if (figures_.interrupted || figures_.out_of_time) break;
    }
    Finish();
    return std::move(figures_);
  }

 private:
  void Step() {
    if (run_.drive) {
      inputs_.assign(inputs_.size(), ToolInput{});
      run_.drive(engine_, &inputs_);
    }
    const Ledger before = engine_.state().ledger;
    const int zones = static_cast<int>(engine_.state().contacts.zones.size());
    const StepReport report = engine_.Step(inputs_);
    ++figures_.steps;
    figures_.bits |= report.bits;
    figures_.captures += report.captures;
    figures_.releases += report.releases;
    if (engine_.frozen()) return;
    const State& state = engine_.state();
    adhesive_j_ += AdhesiveGain(before, state.ledger);
    sliding_j_ += SlidingGain(before, state.ledger);
    const int now = static_cast<int>(state.contacts.zones.size());
    if (report.captures > 0) figures_.fewer_zones = std::max(figures_.fewer_zones, zones - now);
    figures_.most_zones = std::max(figures_.most_zones, now);
    for (const Zone& zone : state.contacts.zones) {
      figures_.most_zone_bodies = std::max(figures_.most_zone_bodies, zone.bodies);
      figures_.most_zone_members = std::max(figures_.most_zone_members, zone.count);
    }
    for (std::size_t t = 0; t < state.tools.size(); ++t) JudgeForce(static_cast<int>(t));
  }

  void JudgeForce(int t) {
    const State& state = engine_.state();
    const CouplingParameters& coupling = model_.tools[t].coupling;
    double carried_kg = 0;
    for (const Zone& zone : state.contacts.zones) {
      if (zone.tool != t) continue;
      for (int k = zone.first; k < zone.first + zone.count; ++k) {
        carried_kg += model_.mass_kg[state.contacts.zone_members[k]];
      }
    }
    // Of what was held at its start or its end. Captures also count what was let go again.
    const double mass_kg = coupling.mass_kg + std::max(carried_kg, carried_kg_[t]);
    carried_kg_[t] = carried_kg;
    const double impulse_ns = 2 * mass_kg * coupling.max_speed_m_s + engine_.CaptureImpulse(t);
    const double most_n = coupling.max_force_n + impulse_ns / model_.dt_s;
    const double tissue_n = state.tools[t].tissue.force_n.norm();
    figures_.peak_force_n = std::max(figures_.peak_force_n, tissue_n);
    figures_.force_over = std::max(figures_.force_over, tissue_n / most_n);
    figures_.coupling_over = std::max(
        figures_.coupling_over, state.tools[t].coupling.force_n.norm() / coupling.max_force_n);
  }

  void SampleEnergy() {
    const Ledger& ledger = engine_.state().ledger;
    const double permitted_j =
        ledger.initial_j + ledger.external_work_j + ledger.tool_work_j + ledger.correction_j;
    figures_.excess_j = std::max(figures_.excess_j, engine_.KeptEnergy() - permitted_j);
  }

  void Sample() {
    const State& state = engine_.state();
    if (may_overlap_) {
      figures_.end_depth_m = MeasurePenetration(model_, state.position_m).max_depth_m;
      // Bodies nearly in the same place get deeper into each other on their way out.
      double& most_m = state.contacts.overlapping ? figures_.overlap_m : figures_.max_depth_m;
      most_m = std::max(most_m, figures_.end_depth_m);
    }
    for (std::size_t t = 0; t < state.tools.size(); ++t) {
      figures_.pierced = std::max(
          figures_.pierced, CountPierced(model_, state.position_m, state.tools[t].pose,
                                         ToolLength(model_.tools[t]), figures_.capture_distance_m));
    }
    const ShapeError shape = MeasureShapeError(model_, state.position_m);
    figures_.end_shape_error = shape.error;
    figures_.end_inverted = shape.inverted;
    const bool at_rest = shape.error < kRestShapeError && shape.inverted == 0;
    if (at_rest && !was_at_rest_) figures_.rest_since_s = state.time_s;
    if (!at_rest) figures_.rest_since_s = std::numeric_limits<double>::infinity();
    was_at_rest_ = at_rest;
  }

  void Finish() {
    const State& state = engine_.state();
    figures_.simulated_s = state.time_s;
    if (engine_.frozen()) {
      figures_.frozen_because = engine_.FrozenBecause();
      return;
    }
    // Where nothing ever moved there is only the noise of rounded positions.
    double mass_kg = 0;
    for (const double m : model_.mass_kg) mass_kg += m;
    const double still_j = 0.5 * mass_kg * kStillSpeedMS * kStillSpeedMS;
    const double reference_j = std::max(EnergyReference(state.ledger), still_j);
    figures_.identity_error = IdentityError(state.ledger);
    if (reference_j > 0) {
      figures_.energy_excess = figures_.excess_j / reference_j;
      figures_.adhesive_share = adhesive_j_ / reference_j;
      figures_.sliding_share = sliding_j_ / reference_j;
      figures_.slid_share = state.ledger.sliding_j / reference_j;
    }
    for (int p = 0; p < model_.particle_count(); ++p) {
      figures_.moved_m = std::max(figures_.moved_m, (state.position_m[p] - start_m_[p]).norm());
      figures_.drift_m = std::max(figures_.drift_m, (state.position_m[p] - half_m_[p]).norm());
      figures_.end_speed_m_s = std::max(figures_.end_speed_m_s, state.velocity_m_s[p].norm());
    }
    figures_.fallen_m = start_height_m_ - MeanHeight(model_, state);
  }

  Engine& engine_;
  const Model& model_;
  const StressRun& run_;
  const std::vector<Vec3> start_m_;
  std::vector<Vec3> half_m_;  // at half of the run
  StressFigures figures_;
  std::vector<ToolInput> inputs_;
  std::vector<double> carried_kg_;  // [#tools] in the step before
  double adhesive_j_ = 0, sliding_j_ = 0, start_height_m_ = 0;
  bool may_overlap_ = false, was_at_rest_ = false;
};

// Adds a failure when a number is above its limit, or none.
void AtMost(double value, double limit, const char* what, std::vector<std::string>* failures) {
  if (value <= limit) return;
  failures->push_back(absl::StrFormat("%s %.3g, at most %.3g", what, value, limit));
}

}  // namespace

StressFigures RunStress(Engine* engine, const StressRun& run) { return Run(engine, run).Go(); }

std::vector<std::string> WhatFails(const StressConditions& conditions,
                                   const StressFigures& figures) {
  std::vector<std::string> failures;
  const StressFigures& f = figures;
  if (f.out_of_time) {
    failures.push_back(absl::StrFormat("only %.3g s simulated in %.0f s", f.simulated_s, f.cpu_s));
    return failures;
  }
  AtMost(f.energy_excess, kEnergyShare, "energy above what was put in, over E_ref", &failures);
  if (conditions.most_excess_j) {
    AtMost(f.excess_j, *conditions.most_excess_j, "energy above what was put in, J", &failures);
  }
  AtMost(f.identity_error, kIdentityShare, "imbalance of energy in a sub-step, over E_ref",
         &failures);
  AtMost(f.adhesive_share, kContactShare, "energy that the adhesive added, over E_ref", &failures);
  AtMost(f.slid_share, kContactShare, "energy that sliding added, over E_ref", &failures);
  if (f.capture_distance_m > 0) {
    AtMost(f.max_depth_m, f.capture_distance_m, "depth, m", &failures);
    AtMost(f.end_depth_m, f.capture_distance_m, "depth at the end, m", &failures);
  }
  AtMost(f.pierced, 0, "triangles pierced by a tool", &failures);
  AtMost(f.coupling_over, 1 + kRounding, "force of a coupling over max_force_n", &failures);
  AtMost(f.force_over, 1 + kRounding, "force on a tool over what it can exert", &failures);
  if (conditions.rest_by_s) {
    AtMost(f.rest_since_s, *conditions.rest_by_s, "time until the shape at rest is back, s",
           &failures);
  }
  return failures;
}

}  // namespace adhesim
