#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "core/effects/registry.h"
#include "core/model/carried.h"
#include "core/study/accuracy_trace.h"

namespace adhesim {
namespace {

// Of the bound at which explicit steps become unstable (2 over the highest frequency; Runge and
// Kutta's method has 2.8): the error of a step is its fifth power.
constexpr double kPartOfBound = 0.5;
constexpr int kStepsBetweenQuestions = 64;

// Positions or velocities of all particles.
using Field = std::vector<Vec3>;

// Positions and velocities, and how fast they change.
struct Motion {
  Field x, v;
};

class RungeKutta {
 public:
  RungeKutta(const Model& model, std::vector<std::unique_ptr<Effect>> effects)
      : model_(model), effects_(std::move(effects)) {
    for (const auto& effect : effects_) {
      std::vector<double>& state = effect_state_.emplace_back(effect->state_size());
      effect->InitialState(state);
    }
    for (Field& force : force_n_) force.assign(model.rest_position_m.size(), Vec3::Zero());
  }

  // Where explicit steps become unstable, from the effects' bounds.
  double BoundS() const {
    const std::size_t n = model_.rest_position_m.size();
    std::vector<double> stiffness(n, 0), damping(n, 0);
    for (const auto& effect : effects_) effect->AddBounds(stiffness, damping);
    double bound_s = std::numeric_limits<double>::infinity();
    for (std::size_t p = 0; p < n; ++p) {
      if (model_.mass_kg[p] == 0) continue;
      const double frequency = std::sqrt(stiffness[p] / model_.mass_kg[p]);
      bound_s = std::min(bound_s, 2 / (frequency + damping[p] / model_.mass_kg[p]));
    }
    return bound_s;
  }

  void Step(double time_s, double dt_s, Motion* now) {
    const Motion k1 = Rate(*now, time_s);
    const Motion k2 = Rate(After(*now, k1, 0.5 * dt_s), time_s + 0.5 * dt_s);
    const Motion k3 = Rate(After(*now, k2, 0.5 * dt_s), time_s + 0.5 * dt_s);
    const Motion k4 = Rate(After(*now, k3, dt_s), time_s + dt_s);
    for (std::size_t p = 0; p < now->x.size(); ++p) {
      now->x[p] += dt_s / 6 * (k1.x[p] + 2 * k2.x[p] + 2 * k3.x[p] + k4.x[p]);
      now->v[p] += dt_s / 6 * (k1.v[p] + 2 * k2.v[p] + 2 * k3.v[p] + k4.v[p]);
    }
    Carry(model_, now->x);
  }

 private:
  static Motion After(const Motion& now, const Motion& rate, double dt_s) {
    Motion then = now;
    for (std::size_t p = 0; p < now.x.size(); ++p) {
      then.x[p] += dt_s * rate.x[p];
      then.v[p] += dt_s * rate.v[p];
    }
    return then;
  }

  // Velocities and accelerations.
  Motion Rate(Motion at, double time_s) {
    Carry(model_, at.x);
    Carry(model_, at.v);
    for (Field& force : force_n_) std::fill(force.begin(), force.end(), Vec3::Zero());
    for (std::size_t e = 0; e < effects_.size(); ++e) {
      effects_[e]->AddForces({at.x, at.v, time_s, effect_state_[e], &one_, {}},
                             {force_n_[0], force_n_[1], force_n_[2], force_n_[3]});
    }
    for (int kind = 1; kind < kForceKinds; ++kind) {
      for (std::size_t p = 0; p < at.x.size(); ++p) force_n_[0][p] += force_n_[kind][p];
    }
    GiveToCarriers(model_, force_n_[0]);
    Motion rate{std::move(at.v), Field(at.x.size(), Vec3::Zero())};
    for (std::size_t p = 0; p < at.x.size(); ++p) {
      if (model_.fixed[p]) {
        rate.x[p].setZero();
      } else if (model_.mass_kg[p] > 0) {
        rate.v[p] = force_n_[0][p] / model_.mass_kg[p];
      }
    }
    return rate;
  }

  const Model& model_;
  std::vector<std::unique_ptr<Effect>> effects_;
  std::vector<std::vector<double>> effect_state_;
  std::array<Field, kForceKinds> force_n_;
  Parallel one_{1};
};

}  // namespace

std::string WhyNotRungeKutta(const Model& model) {
  if (!model.tools.empty()) return "it has tools";
  if (model.adhesive) return "it has contact";
  for (const Body& body : model.bodies) {
    if (body.rigid && !body.all_fixed) return "it has rigid bodies";
  }
  for (const v1::Effect& message : model.scene.effects()) {
    if (message.has_virtual_adhesive()) return "it has contact";
    const absl::StatusOr<std::unique_ptr<Effect>> effect = MakeEffect(model, message);
    if (!effect.ok()) return std::string(effect.status().message());
    if (!(*effect)->constraints().empty()) return "it has constraints";
    if ((*effect)->contact_reach_m() > 0) return "it has contact";
  }
  return "";
}

AccuracyTrace RunRungeKutta(const Model& model, const AccuracyProbes& probes,
                            const TraceOptions& options) {
  AccuracyTrace trace;
  trace.failed = WhyNotRungeKutta(model);
  if (!trace.failed.empty()) return trace;
  std::vector<std::unique_ptr<Effect>> effects;
  for (const v1::Effect& message : model.scene.effects()) {
    effects.push_back(*MakeEffect(model, message));
  }
  RungeKutta method(model, std::move(effects));
  // Steps in a common step: every instant is hit.
  const auto parts = static_cast<std::int64_t>(
      std::max(1.0, std::ceil(options.common_step_s / (kPartOfBound * method.BoundS()))));
  const double dt_s = options.common_step_s / static_cast<double>(parts);
  trace.rate_hz = 1 / dt_s;
  trace.substeps = 1;
  const AccuracyProbes::Places places = probes.On(model);
  Motion now{model.rest_position_m, model.initial_velocity_m_s};
  for (std::int64_t step = 1; trace.time_s.size() < options.instants_s.size(); ++step) {
    if (step % kStepsBetweenQuestions == 0 && options.out_of_time && options.out_of_time()) {
      trace.left_out = true;
      return trace;
    }
    method.Step(static_cast<double>(step - 1) * dt_s, dt_s, &now);
    const double instant_s = options.instants_s[trace.time_s.size()];
    if (step < std::llround(instant_s / dt_s)) continue;
    AddInstant(model, places, instant_s, now.x, options, &trace);
    trace.force_n.emplace_back();
    trace.colliding_share.push_back(0);
    if (!std::isfinite(trace.radius_m.back())) {
      trace.failed = absl::StrFormat("became non-finite before %.4g s", instant_s);
      return trace;
    }
  }
  return trace;
}

}  // namespace adhesim
