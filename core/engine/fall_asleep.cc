// The parts of a sub-step in which bodies wake and fall asleep.

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <bit>

#include "core/engine/heap_meter.h"
#include "core/engine/pipeline.h"

namespace adhesim {

absl::Status Pipeline::CompileSleep() {
  if (!model_->sleep) return absl::OkStatus();
  if (adhesive_ && (model_->adhesive->ties || model_->adhesive->bell)) {
    return absl::InvalidArgumentError(
        "sleep: ties give way and chance lets go while nothing moves (permitted: virtual_adhesive "
        "without ties and bell, or no sleep)");
  }
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    if (effects_[e]->lets_sleep()) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(effect_path_[e],
                     " acts on bodies at rest, or does not say what it leaves out (permitted "
                     "with sleep: volume_preservation, shape_memory, elasticity, "
                     "uniform_gravity, drag, drying with a gain of 1 or more, virtual_adhesive)"));
  }
  HeapMeter heap;
  // Stiffness is one matrix of all bodies, and its effects work in batches across them.
  const bool together = std::any_of(effects_.begin(), effects_.end(),
                                    [](const auto& effect) { return effect->has_stiffness(); });
  sleeping_ = std::make_unique<Sleeping>(*model_, detector_ ? detector_->reach_m() : 0, together);
  tool_box_.reserve(model_->tools.size());
  strain_energy_j_.resize(model_->rest_position_m.size());
  Sleeping::Start(*model_, &start_);
  Sleeping::Reserve(*model_, &state_);
  bytes_.sleep = heap.Take();
  return absl::OkStatus();
}

std::span<const Aabb> Pipeline::ToolBoxes() {
  tool_box_.clear();
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    if (retracted_[t]) continue;
    tool_box_.push_back(tool_set_->Bounds(static_cast<int>(t), state_.tools[t].pose));
  }
  return tool_box_;
}

void Pipeline::Wake() {
  if (!sleeping_->Wake(detector_->pairs(), ToolBoxes(), &state_)) return;
  Forget();
  searched_ = false;  // what is near them is looked for in this sub-step
}

// Once a step, when forces and energies of the positions now are known: what falls asleep keeps
// them.
void Pipeline::FallAsleep() {
  std::span<const BodyPair> pairs;
  if (detector_) pairs = detector_->pairs();
  const auto of_kind = [&](ForceKind kind) -> std::span<const Vec3> {
    return force_n_[std::countr_zero(static_cast<std::uint32_t>(kind))];
  };
  const Sleeping::Forces forces{of_kind(kElastic), of_kind(kField)};
  const std::span<const std::int32_t> tired = sleeping_->Tire(pairs, ToolBoxes(), forces, &state_);
  if (tired.empty()) return;
  std::fill(strain_energy_j_.begin(), strain_energy_j_.end(), 0.0);
  for (const auto& effect : effects_) {
    if (effect->force_kinds() & kElastic) effect->AddEnergies(strain_energy_j_);
  }
  const auto stop = [](std::span<Vec3> vectors, const Body& body) {
    if (vectors.empty()) return;
    std::fill_n(vectors.begin() + body.first_particle, body.particle_count, Vec3::Zero());
  };
  for (int b : tired) {
    const Body& body = model_->bodies[b];
    BookSleep(*model_, body, &state_);
    stop(state_.velocity_m_s, body);
    stop(total_force_n_, body);
    for (auto& force : force_n_) stop(force, body);
  }
  sleeping_->PutToSleep(tired, solver_->load_n(), strain_energy_j_, &state_);
  LeaveOutSleepers();
}

void Pipeline::LeaveOutSleepers() {
  solver_->LeaveOut(state_);
  if (detector_) detector_->LeaveOut(&state_.sleep);
}

// Another state: forces on its sleepers are none, whatever they were here.
void Pipeline::RestoreSleep() {
  std::fill(total_force_n_.begin(), total_force_n_.end(), Vec3::Zero());
  for (auto& force : force_n_) std::fill(force.begin(), force.end(), Vec3::Zero());
  if (adhesive_) adhesive_->LeaveOut(&state_.sleep);
  LeaveOutSleepers();
}

}  // namespace adhesim
