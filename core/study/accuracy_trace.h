#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/engine/engine.h"
#include "core/model/model.h"

namespace adhesim {

// Points of the surfaces that every run is watched at: surface particles of the scene's own mesh
// that can move, at rest. On another mesh such a point moves with the triangle nearest to it.
class AccuracyProbes {
 public:
  explicit AccuracyProbes(const Model& model);

  int count() const { return static_cast<int>(rest_m_.size()); }
  const std::vector<Vec3>& rest_m() const { return rest_m_; }

  // Where the probes are on a mesh of the same bodies.
  struct Places {
    std::vector<Triangle> triangle;  // [#probes]
    std::vector<Vec3> weights;       // barycentric
    std::vector<Vec3> rest_m;
  };
  Places On(const Model& model) const;

 private:
  std::vector<Vec3> rest_m_;  // [#probes]
  std::vector<int> body_;     // index into Model::bodies
};

// Where the probes are now [#probes]: their places at rest and what their triangles moved by.
std::vector<Vec3> ProbePositions(const AccuracyProbes::Places& places, const Model& model,
                                 std::span<const Vec3> position_m);

// Something that happened to contact in a run, known to a step.
struct ContactEvent {
  std::string what;  // "bodies touch", "bodies part", "probe touches", "probe lets go"
  double time_s = 0;
};

// What is kept of a run, to compare it with others.
struct AccuracyTrace {
  std::string failed;      // why it did not load, or where it ended; empty: it ran to its end
  bool left_out = false;   // it was out of time, which is no failure
  std::uint32_t bits = 0;  // StepBit of any step
  double rate_hz = 0;
  int substeps = 0;
  // At each instant.
  std::vector<double> time_s;
  std::vector<std::vector<Vec3>> position_m;  // [#instants][#probes]
  // [#instants][#tools] of tissue on the tool: its mean since the instant before, which does not
  // depend on how many steps share an impact.
  std::vector<std::vector<Vec3>> force_n;
  std::vector<double> radius_m;         // of gyration of the probes
  std::vector<double> colliding_share;  // of the particles
  std::vector<double> deflection_m;     // of a beam's end (accuracy_formula), or empty
  std::vector<ContactEvent> events;
};

// What runs cost.
struct AccuracyCost {
  std::vector<double> run_wall_s;    // of each repeat that came to its end
  std::vector<double> run_cpu_s;     // of the stepping thread
  std::vector<double> step_wall_ms;  // [#steps] least of all repeats: the same work each time
};

// What steps of one run took, in their order.
struct StepTimes {
  double wall_s = 0, cpu_s = 0;
  std::vector<double> wall_ms;
};
void AddTo(const StepTimes& times, AccuracyCost* cost);
// Makes a step and adds its time.
void TimeStep(const std::function<void()>& step, StepTimes* times);

struct TraceOptions {
  // Ascending; the last ends the run. All are multiples of a step that every run's divides.
  std::vector<double> instants_s;
  double common_step_s = 0.01;
  std::function<bool()> out_of_time = nullptr;  // asked now and then
  // The deflection of a beam's end, where there is such a thing.
  std::function<double(const Model&, std::span<const Vec3>)> deflection = nullptr;
};

// Runs an engine from its start, tools on their trajectories. Adds to `cost` when it came to its
// end, unless that is null.
AccuracyTrace RunTrace(Engine* engine, const AccuracyProbes& probes, const TraceOptions& options,
                       AccuracyCost* cost);

// The same problem by the classical Runge-Kutta method of fourth order: a second integrator that
// shares no stepping code with the engine, only the effects' forces. For scenes without contact,
// tools, rigid bodies and constraints; `WhyNotRungeKutta` says which of them a scene has (empty:
// none). Steps are half of what explicit steps need to be stable.
std::string WhyNotRungeKutta(const Model& model);
AccuracyTrace RunRungeKutta(const Model& model, const AccuracyProbes& probes,
                            const TraceOptions& options);

// Whether a surface point is further from its start than anything can be that is still a solution,
// or no number: what is said of that.
std::string WhatIsLost(const Model& model, const AccuracyProbes::Places& places,
                       const AccuracyTrace& trace);

// Adds the instant to a trace: probes, radius and deflection.
void AddInstant(const Model& model, const AccuracyProbes::Places& places, double time_s,
                std::span<const Vec3> position_m, const TraceOptions& options,
                AccuracyTrace* trace);

}  // namespace adhesim
