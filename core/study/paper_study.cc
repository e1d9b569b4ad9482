#include "core/study/paper_study.h"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/contact/penetration.h"
#include "core/model/bond_geometry.h"
#include "core/model/diagnostics.h"
#include "core/study/bodies_energy.h"
#include "core/study/contact_gain.h"
#include "core/study/rolling.h"
#include "core/study/timing.h"

namespace adhesim {
namespace {

// Overlap is measured in every sample up to so many particles, then in as many fewer as there are
// more of them: winding numbers of 100 000 particles take longer than the steps between samples.
constexpr int kParticlesMeasuredEachTime = 2000;

// Mean by mass of the values of particles [first, first + count).
Vec3 MeanByMass(const Model& model, std::span<const Vec3> values, int first, int count) {
  Vec3 sum = Vec3::Zero();
  double mass = 0;
  for (int p = first; p < first + count; ++p) {
    sum += model.mass_kg[p] * values[p];
    mass += model.mass_kg[p];
  }
  return sum / mass;
}

double RadiusOfGyration(const Model& model, const State& state) {
  const Vec3 centre = MeanByMass(model, state.position_m, 0, model.particle_count());
  double sum = 0, mass = 0;
  for (int p = 0; p < model.particle_count(); ++p) {
    sum += model.mass_kg[p] * (state.position_m[p] - centre).squaredNorm();
    mass += model.mass_kg[p];
  }
  return std::sqrt(sum / mass);
}

std::optional<double> SmallestRadius(const Model& model) {
  std::optional<double> smallest;
  for (const Body& body : model.bodies) {
    if (!body.closed) continue;
    Vec3 middle = Vec3::Zero();
    const auto first = model.rest_position_m.begin() + body.first_particle;
    const auto end = first + body.particle_count;
    middle = std::accumulate(first, end, middle) / body.particle_count;
    double furthest = 0;
    for (auto p = first; p != end; ++p) furthest = std::max(furthest, (*p - middle).norm());
    smallest = std::min(smallest.value_or(furthest), furthest);
  }
  return smallest;
}

// Mean distance between the two points of a pair that holds: of a particle or an edge, and of a
// triangle.
std::optional<double> MeanGap(const Model& model, const State& state) {
  double sum = 0;
  int count = 0;
  for (const Bond& bond : state.contacts.bonds) {
    if (bond.particle < 0) continue;
    const Triangle& triangle = model.triangles[bond.triangle];
    Vec3 point = Vec3::Zero();
    for (int k = 0; k < 3; ++k) point += bond.weights[k] * state.position_m[triangle[k]];
    sum += (GeometryOf(bond, model, state.position_m).point_m - point).norm();
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

// Bodies of the largest group that bonds connect.
int LargestGroup(const Model& model, const State& state) {
  std::vector<int> parent(model.bodies.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int body) {
    while (parent[body] != body) body = parent[body] = parent[parent[body]];
    return body;
  };
  for (const Bond& bond : state.contacts.bonds) {
    if (bond.particle < 0) continue;
    const int other = model.body_of[model.triangles[bond.triangle][0]];
    parent[root(model.body_of[bond.particle])] = root(other);
  }
  std::vector<int> size(parent.size());
  for (std::size_t body = 0; body < parent.size(); ++body) ++size[root(static_cast<int>(body))];
  return *std::max_element(size.begin(), size.end());
}

// Only closed bodies can have something of another body inside.
bool MayOverlap(const Model& model) {
  const auto closed = [](const Body& body) { return body.closed; };
  return model.bodies.size() > 1 && std::any_of(model.bodies.begin(), model.bodies.end(), closed);
}

// Bodies of the zone that holds the most.
int LargestZone(const State& state) {
  int most = 0;
  for (const Zone& zone : state.contacts.zones) most = std::max(most, zone.bodies);
  return most;
}

// Most of an energy above what was put in, over E_ref.
template <typename Energy>
double MostAbove(const PaperStudy& study, const Energy& energy_j) {
  double most_j = 0;
  for (const StudySample& sample : study.samples) {
    most_j = std::max(most_j, energy_j(sample) - sample.permitted_j);
  }
  return study.reference_j > 0 ? most_j / study.reference_j : 0;
}

class Study {
 public:
  Study(Engine* engine, const StudyOptions& options)
      : engine_(*engine), model_(engine->model()), options_(options) {
    result_.bodies = static_cast<int>(model_.bodies.size());
    result_.particles = model_.particle_count();
    result_.triangles = static_cast<int>(model_.triangles.size());
    result_.dt_s = model_.dt_s;
    if (model_.adhesive) {
      result_.capture_distance_m = model_.adhesive->capture_distance_m;
      result_.release_distance_m = model_.adhesive->release_distance_m;
    }
    result_.smallest_radius_m = SmallestRadius(model_);
    may_overlap_ = MayOverlap(model_);
    for (const Body& body : model_.bodies) {
      if (body.closed && body.name == options.rolling_body) {
        rolling_.emplace(model_, body, engine->state());
      }
      if (!body.name.empty() && body.name == options.followed_body) {
        followed_ = &body;
        followed_start_m_ = Centre(body);
      }
    }
    // The engine has made each of these effects before.
    absl::StatusOr<BodiesEnergy> bodies = BodiesEnergy::Create(model_);
    if (bodies.ok() && bodies->contact_by_effects()) bodies_energy_ = *std::move(bodies);
  }

  PaperStudy Run() {
    const std::int64_t steps =
        std::max<std::int64_t>(1, std::llround(options_.duration_s / model_.dt_s));
    const std::int64_t samples = std::clamp<std::int64_t>(options_.samples, 1, steps);
    Sample(true);
    PassInstants(0, steps);
    std::int64_t sampled = 0;
    for (std::int64_t step = 1; step <= steps; ++step) {
      result_.interrupted = options_.stop && options_.stop();
      if (result_.interrupted) break;
      Step(2 * step > steps);
      result_.finite = !engine_.frozen();
      if (!result_.finite) break;
      if (step * samples >= (sampled + 1) * steps) {
        ++sampled;
        Sample(step == steps);
      }
      PassInstants(step, steps);
    }
    Finish();
    return std::move(result_);
  }

 private:
  void Step(bool second_half) {
    const Ledger before = engine_.state().ledger;
    const double start_ms = ThreadCpuMs();
    const StepReport report = engine_.Step({});
    const double cpu_ms = ThreadCpuMs() - start_ms;
    ++result_.steps;
    result_.report_bits |= report.bits;
    contact_added_j_ +=
        AdhesiveGain(before, engine_.state().ledger) + SlidingGain(before, engine_.state().ledger);
    recent_ms_.push_back(cpu_ms);
    if (!second_half) return;
    second_half_ms_.push_back(cpu_ms);
    second_half_colliding_ += engine_.state().contacts.colliding_particles;
  }

  void Sample(bool thorough) {
    const State& state = engine_.state();
    const Ledger& ledger = state.ledger;
    StudySample sample;
    sample.time_s = state.time_s;
    sample.cpu_ms = Percentile(recent_ms_, 0.5);
    recent_ms_.clear();
    sample.colliding_particles = state.contacts.colliding_particles;
    sample.zones = static_cast<int>(state.contacts.zones.size());
    sample.energy_j = engine_.MechanicalEnergy();
    // The ledger is opened by the first step.
    sample.permitted_j = state.step == 0 ? sample.energy_j
                                         : ledger.initial_j + ledger.external_work_j +
                                               ledger.tool_work_j + ledger.correction_j;
    sample.contact_added_j = contact_added_j_;
    sample.captured_j = ledger.captured_j;
    sample.viscous_j = ledger.viscous_j;
    sample.slid_j = -ledger.sliding_j;
    sample.pushed_j = ledger.correction_j;
    if (bodies_energy_) sample.bodies_energy_j = bodies_energy_->Of(state);
    sample.radius_m = RadiusOfGyration(model_, state);
    if (model_.bodies.size() > 1) {
      sample.separation_m = (Centre(model_.bodies[0]) - Centre(model_.bodies[1])).norm();
    }
    if (followed_ != nullptr) {
      sample.moved_m = (Centre(*followed_) - followed_start_m_).norm();
      sample.speed_m_s = Mean(state.velocity_m_s, *followed_).norm();
    }
    if (rolling_) {
      rolling_->Sample(state);
      sample.revolutions = rolling_->revolutions();
      sample.rolled_m = rolling_->rolled_m();
      sample.travel_m = rolling_->travel_m();
      sample.slip_m = rolling_->slip_m();
    }
    sample.group_bodies = LargestGroup(model_, state);
    sample.zone_bodies = LargestZone(state);
    sample.mean_gap_m = MeanGap(model_, state);
    sample.volume_error = VolumeError(model_, state);
    const int sparsely = 1 + model_.particle_count() / kParticlesMeasuredEachTime;
    if (may_overlap_ && (thorough || result_.samples.size() % sparsely == 0)) {
      const Penetration overlap = MeasurePenetration(model_, state.position_m);
      sample.max_depth_m = overlap.max_depth_m;
      sample.vertices_inside = overlap.vertices_inside;
    }
    const MomentumError error = MomentumBalance(model_, state);
    imbalance_.linear = std::max(imbalance_.linear, error.linear * state.momentum.scale_linear);
    imbalance_.angular = std::max(imbalance_.angular, error.angular * state.momentum.scale_angular);
    result_.samples.push_back(sample);
  }

  // Of a body's particles, by mass.
  Vec3 Mean(std::span<const Vec3> values, const Body& body) const {
    return MeanByMass(model_, values, body.first_particle, body.particle_count);
  }
  Vec3 Centre(const Body& body) const { return Mean(engine_.state().position_m, body); }

  // Instants that are at this step or before it.
  void PassInstants(std::int64_t step, std::int64_t steps) {
    while (next_instant_ < options_.instants.size() &&
           std::llround(options_.instants[next_instant_] * static_cast<double>(steps)) <= step) {
      result_.instants.push_back(
          {engine_.state().time_s, engine_.state().contacts.colliding_particles});
      if (options_.at_instant) options_.at_instant();
      ++next_instant_;
    }
  }

  void Finish() {
    const State& state = engine_.state();
    result_.cpu_ms_median = Percentile(second_half_ms_, 0.5);
    result_.cpu_ms_p99 = Percentile(second_half_ms_, 0.99);
    if (!second_half_ms_.empty()) {
      result_.second_half_colliding =
          second_half_colliding_ / static_cast<double>(second_half_ms_.size());
    }
    result_.reference_j = EnergyReference(state.ledger);
    result_.identity_error = IdentityError(state.ledger);
    const auto relative = [](double error, double scale) { return scale > 0 ? error / scale : 0; };
    result_.momentum_linear = relative(imbalance_.linear, state.momentum.scale_linear);
    result_.momentum_angular = relative(imbalance_.angular, state.momentum.scale_angular);
  }

  Engine& engine_;
  const Model& model_;
  const StudyOptions& options_;
  PaperStudy result_;
  bool may_overlap_ = false;
  std::optional<RollingMeter> rolling_;
  std::optional<BodiesEnergy> bodies_energy_;
  const Body* followed_ = nullptr;
  Vec3 followed_start_m_ = Vec3::Zero();
  std::vector<double> recent_ms_, second_half_ms_;
  double second_half_colliding_ = 0;
  double contact_added_j_ = 0;
  MomentumError imbalance_;  // kg m/s, kg m^2/s
  std::size_t next_instant_ = 0;
};

}  // namespace

PaperStudy RunPaperStudy(Engine* engine, const StudyOptions& options) {
  return Study(engine, options).Run();
}

double EnergyExcess(const PaperStudy& study) {
  return MostAbove(study, [](const StudySample& sample) { return sample.energy_j; });
}

double BodiesExcess(const PaperStudy& study) {
  return MostAbove(study, [](const StudySample& sample) {
    return sample.bodies_energy_j.value_or(sample.energy_j);
  });
}

}  // namespace adhesim
