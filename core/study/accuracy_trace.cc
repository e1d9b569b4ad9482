#include "core/study/accuracy_trace.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "core/model/closest_point.h"
#include "core/study/timing.h"

namespace adhesim {
namespace {

constexpr int kMostProbes = 400;
// Of the scene's extent at the start: a surface point that is further away is lost.
constexpr double kLost = 100;
constexpr int kStepsBetweenQuestions = 16;
constexpr std::int64_t kStepsReserved = 1 << 20;  // longer runs end by the budget

double Extent(std::span<const Vec3> points_m) {
  Aabb box;
  for (const Vec3& x : points_m) box.Add(x);
  return points_m.empty() ? 0 : (box.max - box.min).norm();
}

// First and last contact of each tool, and among bodies.
class EventWatch {
 public:
  explicit EventWatch(const Model& model) : held_(model.tools.size() + 1), name_{"bodies"} {
    for (const ToolModel& tool : model.tools) name_.push_back(tool.name);
  }

  void Look(const State& state) {
    std::vector<bool> held(held_.size(), false);
    for (const Bond& bond : state.contacts.bonds) held[bond.tool + 1] = true;
    for (std::size_t i = 0; i < held.size(); ++i) {
      Held& one = held_[i];
      if (held[i] && one.first_s < 0) one.first_s = state.time_s;
      if (!held[i] && one.now) one.last_s = state.time_s;
      one.now = held[i];
    }
  }

  std::vector<ContactEvent> Events() const {
    std::vector<ContactEvent> events;
    for (std::size_t i = 0; i < held_.size(); ++i) {
      if (held_[i].first_s < 0) continue;
      events.push_back({absl::StrCat(name_[i], i == 0 ? " touch" : " touches"), held_[i].first_s});
      if (held_[i].now) continue;
      events.push_back({absl::StrCat(name_[i], i == 0 ? " part" : " lets go"), held_[i].last_s});
    }
    return events;
  }

 private:
  struct Held {
    double first_s = -1;
    double last_s = -1;  // when it ended last
    bool now = false;
  };
  std::vector<Held> held_;  // of bodies among each other, then of each tool
  std::vector<std::string> name_;
};

class TraceRun {
 public:
  TraceRun(Engine* engine, const AccuracyProbes& probes, const TraceOptions& options)
      : engine_(*engine),
        options_(options),
        places_(probes.On(engine->model())),
        watch_(engine->model()),
        impulse_n_s_(engine->model().tools.size(), Vec3::Zero()) {
    const Model& model = engine_.model();
    trace_.rate_hz = 1 / model.dt_s;
    trace_.substeps = engine_.substeps();
  }

  AccuracyTrace Run(AccuracyCost* cost) {
    engine_.Reset();
    const double dt_s = engine_.model().dt_s;
    const std::int64_t steps = std::llround(options_.instants_s.back() / dt_s);
    times_.wall_ms.reserve(std::min(steps, kStepsReserved));
    for (std::int64_t step = 1; step <= steps; ++step) {
      if (step % kStepsBetweenQuestions == 0 && options_.out_of_time && options_.out_of_time()) {
        trace_.left_out = true;
        return std::move(trace_);
      }
      Step();
      if (engine_.frozen()) {
        trace_.failed =
            absl::StrFormat("froze at %.4g s: the state became non-finite", engine_.state().time_s);
        return std::move(trace_);
      }
      const double instant_s = options_.instants_s[trace_.time_s.size()];
      if (step >= std::llround(instant_s / dt_s)) Instant(instant_s);
      if (!trace_.failed.empty()) return std::move(trace_);
    }
    trace_.events = watch_.Events();
    if (cost != nullptr) AddTo(times_, cost);
    return std::move(trace_);
  }

 private:
  void Step() {
    TimeStep([this] { trace_.bits |= engine_.Step({}).bits; }, &times_);
    const State& state = engine_.state();
    watch_.Look(state);
    for (std::size_t t = 0; t < impulse_n_s_.size(); ++t) {
      impulse_n_s_[t] += engine_.model().dt_s * state.tools[t].tissue.force_n;
    }
  }

  void Instant(double time_s) {
    const State& state = engine_.state();
    const double since_s = time_s - (trace_.time_s.empty() ? 0 : trace_.time_s.back());
    AddInstant(engine_.model(), places_, time_s, state.position_m, options_, &trace_);
    for (Vec3& sum : impulse_n_s_) sum /= since_s;
    trace_.force_n.push_back(impulse_n_s_);
    for (Vec3& sum : impulse_n_s_) sum.setZero();
    trace_.colliding_share.push_back(static_cast<double>(state.contacts.colliding_particles) /
                                     engine_.model().particle_count());
    trace_.failed = WhatIsLost(engine_.model(), places_, trace_);
  }

  Engine& engine_;
  const TraceOptions& options_;
  AccuracyProbes::Places places_;
  EventWatch watch_;
  std::vector<Vec3> impulse_n_s_;  // [#tools] since the last instant
  StepTimes times_;
  AccuracyTrace trace_;
};

}  // namespace

AccuracyProbes::AccuracyProbes(const Model& model) {
  std::vector<char> seen(model.rest_position_m.size(), 0);
  std::vector<int> surface;
  for (const Triangle& triangle : model.triangles) {
    for (const int p : triangle) {
      if (seen[p] || model.fixed[p]) continue;
      seen[p] = 1;
      surface.push_back(p);
    }
  }
  std::sort(surface.begin(), surface.end());
  const std::size_t stride = 1 + surface.size() / kMostProbes;
  for (std::size_t i = 0; i < surface.size(); i += stride) {
    rest_m_.push_back(model.rest_position_m[surface[i]]);
    body_.push_back(model.body_of[surface[i]]);
  }
}

AccuracyProbes::Places AccuracyProbes::On(const Model& model) const {
  Places places;
  const std::vector<Vec3>& x = model.rest_position_m;
  for (std::size_t i = 0; i < rest_m_.size(); ++i) {
    const Body& body = model.bodies[body_[i]];
    double nearest_sq = std::numeric_limits<double>::infinity();
    Triangle on{};
    Vec3 weights = Vec3::Zero();
    for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
      const Triangle& triangle = model.triangles[t];
      const ClosestPoint closest =
          ClosestPointOnTriangle(rest_m_[i], x[triangle[0]], x[triangle[1]], x[triangle[2]]);
      if (closest.distance_sq_m2 >= nearest_sq) continue;
      nearest_sq = closest.distance_sq_m2;
      on = triangle;
      weights = closest.weights;
    }
    places.triangle.push_back(on);
    places.weights.push_back(weights);
    places.rest_m.push_back(rest_m_[i]);
  }
  return places;
}

std::vector<Vec3> ProbePositions(const AccuracyProbes::Places& places, const Model& model,
                                 std::span<const Vec3> position_m) {
  std::vector<Vec3> at(places.rest_m);
  for (std::size_t i = 0; i < at.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const int p = places.triangle[i][k];
      at[i] += places.weights[i][k] * (position_m[p] - model.rest_position_m[p]);
    }
  }
  return at;
}

void TimeStep(const std::function<void()>& step, StepTimes* times) {
  const double cpu_ms = ThreadCpuMs();
  const auto start = std::chrono::steady_clock::now();
  step();
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  times->cpu_s += 1e-3 * (ThreadCpuMs() - cpu_ms);
  times->wall_s += wall.count();
  times->wall_ms.push_back(1e3 * wall.count());
}

void AddTo(const StepTimes& times, AccuracyCost* cost) {
  cost->run_wall_s.push_back(times.wall_s);
  cost->run_cpu_s.push_back(times.cpu_s);
  std::vector<double>& least = cost->step_wall_ms;
  if (least.empty()) least = times.wall_ms;
  for (std::size_t k = 0; k < least.size(); ++k) least[k] = std::min(least[k], times.wall_ms[k]);
}

std::string WhatIsLost(const Model& model, const AccuracyProbes::Places& places,
                       const AccuracyTrace& trace) {
  const double lost_m = kLost * Extent(model.rest_position_m);
  for (std::size_t p = 0; p < places.rest_m.size(); ++p) {
    if ((trace.position_m.back()[p] - places.rest_m[p]).norm() <= lost_m) continue;
    return absl::StrFormat("diverged: a surface point was lost before %.4g s", trace.time_s.back());
  }
  return "";
}

void AddInstant(const Model& model, const AccuracyProbes::Places& places, double time_s,
                std::span<const Vec3> position_m, const TraceOptions& options,
                AccuracyTrace* trace) {
  trace->time_s.push_back(time_s);
  trace->position_m.push_back(ProbePositions(places, model, position_m));
  const std::vector<Vec3>& at = trace->position_m.back();
  Vec3 centre = Vec3::Zero();
  for (const Vec3& x : at) centre += x / static_cast<double>(at.size());
  double sum = 0;
  for (const Vec3& x : at) sum += (x - centre).squaredNorm();
  trace->radius_m.push_back(at.empty() ? 0 : std::sqrt(sum / static_cast<double>(at.size())));
  if (options.deflection) trace->deflection_m.push_back(options.deflection(model, position_m));
}

AccuracyTrace RunTrace(Engine* engine, const AccuracyProbes& probes, const TraceOptions& options,
                       AccuracyCost* cost) {
  return TraceRun(engine, probes, options).Run(cost);
}

}  // namespace adhesim
