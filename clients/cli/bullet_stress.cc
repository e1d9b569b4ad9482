#include "clients/cli/bullet_stress.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/cli/bullet_tissue.h"
#include "core/contact/penetration.h"
#include "core/engine/engine.h"
#include "core/scene/build_model.h"
#include "core/scene/field_value.h"
#include "core/scene/validate.h"
#include "core/study/shape_error.h"
#include "core/study/timing.h"

namespace adhesim {
namespace {

constexpr int kSamples = 100;
constexpr double kRestShapeError = 0.01;  // as of ours (stress_run.cc)

// Cases that are about what sticks, whatever their bodies are.
constexpr std::string_view kSticky[] = {"strength_zero", "strength_infinite", "chatter",
                                        "zone_of_one",   "zone_of_two",       "zone_collinear",
                                        "zone_coplanar", "three_bodies",      "sandwich",
                                        "claimed_twice", "merges_1000"};

std::string WhyNot(const StressCase& stress_case, const Model& model) {
  if (std::find(std::begin(kSticky), std::end(kSticky), stress_case.name) != std::end(kSticky)) {
    return "nothing sticks in it";
  }
  return BulletTissue::WhyNot(model);
}

Vec3 GravityOf(const v1::Scene& scene) {
  Vec3 sum = Vec3::Zero();
  for (const v1::Effect& effect : scene.effects()) {
    if (effect.has_uniform_gravity()) sum += Vec3Of(effect.uniform_gravity(), "acceleration_m_s2");
  }
  return sum;
}

// Watches a run as RunStress() does ours.
class Watch {
 public:
  Watch(const StressCase& stress_case, std::shared_ptr<const Model> model, Engine* energies,
        std::vector<Vec3> start_m)
      : case_(stress_case),
        model_(*model),
        energies_(*energies),
        start_m_(std::move(start_m)),
        position_m_(start_m_),
        half_m_(start_m_),
        velocity_m_s_(start_m_.size(), Vec3::Zero()),
        gravity_m_s2_(GravityOf(model_.scene)) {
    figures_.particles = model_.particle_count();
    if (model_.adhesive) figures_.capture_distance_m = model_.adhesive->capture_distance_m;
    figures_.overlap_m = Depth();
    overlaps_ = overlapped_ = figures_.overlap_m > figures_.capture_distance_m;
    initial_j_ = most_j_ = Energy();
  }

  void Run(BulletTissue* bullet, double dt_s, double cpu_limit_s,
           const std::function<bool()>& stop) {
    const std::int64_t steps = std::max<std::int64_t>(1, std::llround(case_.duration_s / dt_s));
    const std::int64_t samples = std::min<std::int64_t>(kSamples, steps);
    std::int64_t sampled = 0;
    figures_.dt_s = dt_s;
    const double began_ms = ThreadCpuMs();
    for (std::int64_t step = 1; step <= steps; ++step) {
      bullet->Step();
      ++figures_.steps;
      figures_.simulated_s = static_cast<double>(step) * dt_s;
      figures_.cpu_s = 1e-3 * (ThreadCpuMs() - began_ms);
      bullet->Read(&position_m_, &velocity_m_s_);
      CountContacts(bullet->contacts());
      if (!IsFinite()) {
        lost_ = absl::StrFormat("became non-finite at %.4g s", figures_.simulated_s);
        return;
      }
      if (2 * step <= steps) half_m_ = position_m_;
      if (step * samples >= (sampled + 1) * steps) {
        ++sampled;
        Sample();
      }
      figures_.interrupted = stop && stop();
      figures_.out_of_time = step < steps && figures_.cpu_s > cpu_limit_s;
      if (figures_.interrupted || figures_.out_of_time) break;
    }
    Finish();
  }

  StressResult Judge() const {
    StressResult result;
    result.figures = figures_;
    result.interrupted = figures_.interrupted;
    std::vector<std::string> failures;
    if (!lost_.empty()) {
      failures.push_back(lost_);
    } else {
      failures = WhatFails(case_.conditions, figures_);
      const char* lacks = case_.shows == nullptr ? nullptr : case_.shows(figures_);
      if (failures.empty() && lacks != nullptr) failures.emplace_back(lacks);
    }
    result.cause = absl::StrJoin(failures, "; ");
    if (failures.empty()) result.outcome = StressOutcome::kSurvived;
    return result;
  }

 private:
  // Beginnings and ends of touching, for what cases show.
  void CountContacts(int now) {
    if (now > contacts_) figures_.captures += now - contacts_;
    if (now < contacts_) figures_.releases += contacts_ - now;
    contacts_ = now;
  }

  bool IsFinite() const {
    return std::all_of(position_m_.begin(), position_m_.end(),
                       [](const Vec3& x) { return x.allFinite(); });
  }

  double Depth() const {
    return model_.bodies.size() > 1 ? MeasurePenetration(model_, position_m_).max_depth_m : 0;
  }

  // Kinetic and elastic, by our law.
  double Energy() {
    State state = energies_.state();
    state.position_m = position_m_;
    state.velocity_m_s = velocity_m_s_;
    energies_.Restore(state);
    return energies_.MechanicalEnergy();
  }

  double Work() const {
    double sum = 0;
    for (std::size_t p = 0; p < position_m_.size(); ++p) {
      sum += model_.mass_kg[p] * gravity_m_s2_.dot(position_m_[p] - start_m_[p]);
    }
    return sum;
  }

  void Sample() {
    const double energy_j = Energy(), work_j = Work();
    most_j_ = std::max(most_j_, energy_j);
    works_j_ += std::abs(work_j - work_j_);
    work_j_ = work_j;
    if (!overlapped_) excess_j_ = std::max(excess_j_, energy_j - initial_j_ - work_j);
    figures_.end_depth_m = Depth();
    overlaps_ = overlaps_ && figures_.end_depth_m > figures_.capture_distance_m;
    double& most_m = overlaps_ ? figures_.overlap_m : figures_.max_depth_m;
    most_m = std::max(most_m, figures_.end_depth_m);
    const ShapeError shape = MeasureShapeError(model_, position_m_);
    figures_.end_shape_error = shape.error;
    figures_.end_inverted = shape.inverted;
    const bool at_rest = shape.error < kRestShapeError && shape.inverted == 0;
    if (at_rest && !was_at_rest_) figures_.rest_since_s = figures_.simulated_s;
    if (!at_rest) figures_.rest_since_s = std::numeric_limits<double>::infinity();
    was_at_rest_ = at_rest;
  }

  void Finish() {
    const double reference_j = most_j_ + works_j_;
    if (reference_j > 0) figures_.energy_excess = excess_j_ / reference_j;
    double fallen = 0, mass_kg = 0;
    for (std::size_t p = 0; p < position_m_.size(); ++p) {
      figures_.moved_m = std::max(figures_.moved_m, (position_m_[p] - start_m_[p]).norm());
      figures_.drift_m = std::max(figures_.drift_m, (position_m_[p] - half_m_[p]).norm());
      figures_.end_speed_m_s = std::max(figures_.end_speed_m_s, velocity_m_s_[p].norm());
      if (model_.fixed[p]) continue;
      fallen += model_.mass_kg[p] * (start_m_[p].z() - position_m_[p].z());
      mass_kg += model_.mass_kg[p];
    }
    if (mass_kg > 0) figures_.fallen_m = fallen / mass_kg;
  }

  const StressCase& case_;
  const Model& model_;
  Engine& energies_;
  const std::vector<Vec3> start_m_;
  std::vector<Vec3> position_m_, half_m_, velocity_m_s_;
  const Vec3 gravity_m_s2_;
  StressFigures figures_;
  std::string lost_;
  int contacts_ = 0;
  bool overlaps_ = false, overlapped_ = false, was_at_rest_ = false;
  double initial_j_ = 0, most_j_ = 0, work_j_ = 0, works_j_ = 0, excess_j_ = 0;
};

}  // namespace

BulletCase RunBulletCase(const StressCase& stress_case, std::optional<double> dt_s,
                         const std::string& scenes_directory, double cpu_limit_s,
                         const std::function<bool()>& stop) {
  BulletCase made;
  if (stress_case.refused != nullptr) {
    made.not_expressible = "it is about what is refused when it is loaded";
    return made;
  }
  SceneFile file = ReadSceneFile(absl::StrCat(scenes_directory, "/", stress_case.scene, ".yaml"));
  if (stress_case.extend != nullptr) stress_case.extend(&file.scene);
  const BuiltModel built = BuildModel(WithDefaults(file.scene), file.directory);
  if (built.model == nullptr) {
    made.not_expressible = "the scene cannot be built";
    return made;
  }
  made.not_expressible = WhyNot(stress_case, *built.model);
  if (!made.not_expressible.empty()) return made;
  const absl::StatusOr<std::unique_ptr<Engine>> energies =
      Engine::Create(built.model, Engine::Options());
  if (!energies.ok()) {
    made.not_expressible = std::string(energies.status().message());
    return made;
  }
  const double step_s = dt_s.value_or(built.model->dt_s);
  BulletTissue bullet(*built.model, step_s, BulletSettings());
  std::vector<Vec3> start_m = built.model->rest_position_m;
  if (stress_case.spoil != nullptr) {
    stress_case.spoil(*built.model, &start_m);
    bullet.StartFrom(start_m);
  }
  Watch watch(stress_case, built.model, energies->get(), std::move(start_m));
  watch.Run(&bullet, step_s, cpu_limit_s, stop);
  made.result = watch.Judge();
  return made;
}

}  // namespace adhesim
