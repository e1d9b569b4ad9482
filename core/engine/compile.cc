#include <absl/strings/str_cat.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/engine/heap_meter.h"
#include "core/engine/pipeline.h"
#include "core/model/carried.h"
#include "core/model/effect_name.h"

namespace adhesim {
namespace {

// Constraint rows of implicit steps times particles: 64 B each.
constexpr std::size_t kMostResponses = std::size_t{1} << 23;

}  // namespace

absl::StatusOr<std::unique_ptr<Engine>> Pipeline::Compile(std::shared_ptr<const Model> model,
                                                          const Options& options) {
  if (options.threads < 1 || options.threads > 64) {
    return absl::InvalidArgumentError(
        absl::StrCat("threads: ", options.threads, " (permitted: 1 to 64)"));
  }
  const std::vector<Simd> available = AvailableSimd();
  if (std::find(available.begin(), available.end(), options.simd) == available.end()) {
    return absl::InvalidArgumentError(absl::StrCat("simd: ", SimdName(options.simd),
                                                   " (this machine has at most ",
                                                   SimdName(available.back()), ")"));
  }
  if (!model->carried.empty() && model->adhesive && model->adhesive->kappa) {
    return absl::InvalidArgumentError(
        "virtual_adhesive: kappa_adh_m is a strength by the mass of a surface's particles, and a "
        "carried surface has none; permitted: strengths, and kappa_adh_m on blocks");
  }
  if (model->adhesive && model->adhesive->ties && model->integrator != Integrator::kExplicit) {
    return absl::InvalidArgumentError(
        "virtual_adhesive: ties are constraints of explicit steps; permitted: integration: "
        "{integrator: explicit}, or zones (ties: false, patch_size_m)");
  }
  std::unique_ptr<Pipeline> pipeline(new Pipeline(std::move(model), options));
  if (absl::Status status = pipeline->CompileEffects(); !status.ok()) return status;
  if (absl::Status status = pipeline->ChooseSubsteps(); !status.ok()) return status;
  if (absl::Status status = pipeline->CompileTools(); !status.ok()) return status;
  if (absl::Status status = pipeline->CompileSleep(); !status.ok()) return status;
  if (absl::Status status = pipeline->CompileRungs(); !status.ok()) return status;
  pipeline->NameStages();
  pipeline->MakeStartState();
  return pipeline;
}

absl::Status Pipeline::CompileEffects() {
  unsigned kinds = 0;
  int state_size = 0;
  std::vector<const Effect*> constraints;
  HeapMeter heap;
  const std::size_t n = model_->rest_position_m.size();
  for (int i = 0; i < model_->scene.effects_size(); ++i) {
    const v1::Effect& message = model_->scene.effects(i);
    const std::string path = absl::StrCat("effects[", i, "].", EffectName(message));
    if (message.has_virtual_adhesive()) {
      adhesive_path_ = path;
      continue;  // contact, not a force: below
    }
    heap.Take();
    absl::StatusOr<std::unique_ptr<Effect>> effect = MakeEffect(*model_, message);
    if (!effect.ok()) return effect.status();
    const int new_kinds = std::popcount((*effect)->force_kinds() & ~kinds);
    kinds |= (*effect)->force_kinds();
    effect_path_.push_back(path);
    bytes_.effects.push_back(heap.Take() + n * sizeof(Vec3) * static_cast<std::size_t>(new_kinds) +
                             sizeof(double) * (*effect)->state_size());
    effect_state_first_.push_back(state_size);
    state_size += (*effect)->state_size();
    strengths_scale_ = strengths_scale_ || (*effect)->scales_strengths();
    if (!(*effect)->constraints().empty()) constraints.push_back(effect->get());
    effects_.push_back(*std::move(effect));
  }
  for (int kind = 0; kind < kForceKinds; ++kind) {
    if (kinds & (1u << kind)) force_n_[kind].assign(n, Vec3::Zero());
  }
  heap.Take();
  total_force_n_.assign(n, Vec3::Zero());
  solver_ = std::make_unique<SubspaceSolver>(*model_, constraints);
  bytes_.solve = heap.Take();
  if (absl::Status status = CompileImplicit(); !status.ok()) return status;
  zone_builder_ = std::make_unique<ZoneBuilder>(*model_);
  CompileContact();
  heap.Take();
  frame_writer_ = std::make_unique<FrameWriter>(*model_, effects_);
  bytes_.book = heap.Take();
  start_.effect_state.assign(state_size, 0);
  return absl::OkStatus();
}

// The effects with rows, where one of these acts on elasticity that is implicit: met after the
// solve, against inertia alone, it would bring energy in.
std::vector<const Effect*> Pipeline::RowsOnTissue() const {
  std::vector<const Effect*> constraints;
  bool on_tissue = false;
  for (const auto& effect : effects_) {
    if (!effect->constraints().empty()) constraints.push_back(effect.get());
    for (const ConstraintRow& row : effect->constraints()) {
      on_tissue = on_tissue || model_->bodies[model_->body_of[row.first]].tetrahedron_count > 0;
    }
  }
  if (!on_tissue) constraints.clear();
  return constraints;
}

absl::Status Pipeline::CompileImplicit() {
  if (model_->integrator == Integrator::kExplicit) return absl::OkStatus();
  std::vector<ImplicitSolver::StiffEffect> stiff;
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    if (effects_[e]->has_stiffness()) stiff.push_back({effects_[e].get(), effect_state_first_[e]});
  }
  if (stiff.empty()) return absl::OkStatus();
  const std::vector<const Effect*> constraints = RowsOnTissue();
  std::size_t rows = 0;
  for (const Effect* effect : constraints) rows += effect->constraints().size();
  if (const std::size_t responses = rows * model_->rest_position_m.size();
      responses > kMostResponses) {
    return absl::InvalidArgumentError(absl::StrCat(
        "volume_preservation of ", rows, " bodies in a scene of ", model_->particle_count(),
        " particles with implicit tissue: their product is ", responses, " (permitted: at most ",
        kMostResponses, "; poisson_ratio says how incompressible tissue is)"));
  }
  HeapMeter heap;
  implicit_ = std::make_unique<ImplicitSolver>(*model_, std::move(stiff), constraints);
  implicit_damping_n_ = total_force_n_;
  bytes_.solve += heap.Take();
  if (!model_->tools.empty()) {
    force_error_ = std::make_unique<ForceError>(*model_, implicit_->rows().count());
    error_bar_.resize(model_->tools.size());
    bytes_.error = heap.Take();
    tool_system_ = std::make_unique<ToolSystem>(*model_, implicit_->rows().count());
    own_inertia_.resize(model_->tools.size());
    coupling_law_.resize(model_->tools.size());
    tool_law_.resize(model_->tools.size());
    bytes_.tools = heap.Take();
  }
  start_.velocity_change_m_s = total_force_n_;
  return absl::OkStatus();
}

void Pipeline::CompileContact() {
  double reach_m = 0;
  const auto feels = [&](double distance_m, double within_m) {
    contact_distance_m_ = reach_m > 0 ? std::min(contact_distance_m_, distance_m) : distance_m;
    reach_m = std::max(reach_m, within_m);
  };
  if (model_->adhesive) {
    HeapMeter heap;
    adhesive_ = std::make_unique<Adhesive>(*model_);
    bytes_.zones = heap.Take();
    const double capture_m = model_->adhesive->capture_distance_m;
    feels(capture_m, std::max(capture_m, model_->adhesive->release_distance_m));
  }
  for (const auto& effect : effects_) {
    if (const double m = effect->contact_reach_m(); m > 0) feels(m, m);
  }
  if (reach_m <= 0) return;
  Detector::Options options;
  if (model_->adhesive) {
    options.edges = true;
    if (model_->adhesive->self_collision) {
      options.self_apart_m = model_->adhesive->release_distance_m;
    }
  }
  HeapMeter heap;
  detector_ = std::make_unique<Detector>(*model_, reach_m, options);
  bytes_.detect = heap.Take();
}

// Symplectic Euler is stable while w^2 dt^2 + 2 d dt < 4 (w^2 = k/m, d = c/m), k and c bounds of
// the row sums.
absl::Status Pipeline::ChooseSubsteps() {
  std::vector<double> stiffness(model_->rest_position_m.size(), 0), damping(stiffness.size(), 0);
  for (const auto& effect : effects_) {
    if (!IsImplicit(*effect)) effect->AddBounds(stiffness, damping);
  }
  for (const CarriedParticle& c : model_->carried) {
    for (int k = 0; k < 4; ++k) {
      stiffness[c.carriers[k]] += std::abs(c.weights[k]) * stiffness[c.particle];
      damping[c.carriers[k]] += std::abs(c.weights[k]) * damping[c.particle];
    }
  }
  double largest_dt_s = std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < stiffness.size(); ++p) {
    if (model_->fixed[p] || !(model_->mass_kg[p] > 0)) continue;
    const double w_sq = stiffness[p] / model_->mass_kg[p], d = damping[p] / model_->mass_kg[p];
    springs_ = springs_ || w_sq > 0;
    if (w_sq > 0) {
      largest_dt_s = std::min(largest_dt_s, (std::sqrt(d * d + 4 * w_sq) - d) / w_sq);
    } else if (d > 0) {
      largest_dt_s = std::min(largest_dt_s, 2 / d);
    }
  }
  const double wanted = std::ceil(model_->dt_s / (model_->stability_fraction * largest_dt_s));
  if (!(wanted <= model_->max_substeps)) {
    return absl::InvalidArgumentError(
        absl::StrCat("an explicit step of ", model_->dt_s, " s needs ", wanted,
                     " sub-steps to be stable; max_substeps permits ", model_->max_substeps,
                     " (raise rate_hz or max_substeps, or lower the stiffness)"));
  }
  substeps_ = std::max(1, static_cast<int>(wanted));
  return absl::OkStatus();
}

absl::Status Pipeline::CompileTools() {
  const std::size_t tools = model_->tools.size();
  if (tools == 0) return absl::OkStatus();
  HeapMeter heap;
  // What is fixed stops tools, whatever body it is part of.
  std::vector<Triangle> fixed;
  for (const Triangle& t : model_->triangles) {
    if (model_->fixed[t[0]] && model_->fixed[t[1]] && model_->fixed[t[2]]) fixed.push_back(t);
  }
  std::vector<ToolSet::Obstacle> obstacles;
  if (!fixed.empty()) obstacles.push_back({model_->rest_position_m, fixed});
  absl::StatusOr<std::unique_ptr<ToolSet>> set = ToolSet::Create(model_->tools, obstacles);
  if (!set.ok()) return set.status();
  tool_set_ = *std::move(set);
  tools_can_collide_ = tools > 1 || !obstacles.empty();
  if (adhesive_) tool_contacts_ = std::make_unique<ToolContacts>(*model_, *tool_set_);
  tool_twist_.resize(tools);
  last_twist_.resize(tools);
  tool_pose_.resize(tools);
  tool_impulse_.resize(tools);
  capture_impulse_ns_.resize(tools);
  coupling_impulse_.resize(tools);
  coupling_now_.resize(tools);
  strength_scale_.assign(tools, 1);
  retracted_.assign(tools, 0);
  tool_flags_.assign(tools, 0);
  solver_->SetTools({last_twist_, tool_twist_, strength_scale_});
  bytes_.tools += heap.Take();
  return absl::OkStatus();
}

Engine::Stage Pipeline::EffectStage(std::size_t e) const {
  const std::string name(effects_[e]->name());
  return {name, "effects: " + name, {effect_path_[e]}, bytes_.effects[e]};
}

void Pipeline::NameStages() {
  std::vector<std::string> contact, solve = {"bodies"}, error = {"tools"};
  if (adhesive_) contact.push_back(adhesive_path_);
  bool rows = false;
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    if (effects_[e]->contact_reach_m() > 0) contact.push_back(effect_path_[e]);
    if (IsImplicit(*effects_[e])) error.push_back(effect_path_[e]);
    if (!effects_[e]->constraints().empty()) {
      rows = true;
      bytes_.solve += bytes_.effects[e];
    } else if (!IsImplicit(*effects_[e])) {
      continue;
    }
    solve.push_back(effect_path_[e]);
  }
  if (detector_)
    detect_stage_ = clock_.Add({"detect", "effects of contact", contact, bytes_.detect});
  if (adhesive_) {
    zones_stage_ =
        clock_.Add({"zones", "effects: virtual_adhesive", {adhesive_path_}, bytes_.zones});
  }
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    const bool acts = effects_[e]->force_kinds() != 0 || effects_[e]->scales_strengths();
    effect_stage_.push_back(acts ? clock_.Add(EffectStage(e)) : -1);
  }
  if (sleeping_) sleep_stage_ = clock_.Add({"sleep", "sleep", {"sleep"}, bytes_.sleep});
  if (tool_set_) tools_stage_ = clock_.Add({"tools", "tools", {"tools"}, bytes_.tools});
  solve_stage_ = clock_.Add(
      {"solve", rows ? "bodies, effects: volume_preservation" : "bodies", solve, bytes_.solve});
  if (force_error_)
    error_stage_ = clock_.Add({"error", "tools' force error bars", error, bytes_.error});
  book_stage_ =
      clock_.Add({"book", "energy and momentum ledgers, frames", {"bodies"}, bytes_.book});
}

void Pipeline::MakeStartState() {
  start_.position_m = model_->rest_position_m;
  start_.velocity_m_s = model_->initial_velocity_m_s;
  Carry(*model_, start_.position_m);
  Carry(*model_, start_.velocity_m_s);
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    effects_[e]->InitialState(
        std::span(start_.effect_state).subspan(effect_state_first_[e], effects_[e]->state_size()));
  }
  for (const ToolModel& tool : model_->tools) {
    ToolState& state = start_.tools.emplace_back();
    state.pose = state.target = tool.start;
  }
  ZoneBuilder::Reserve(*model_, &start_.contacts);
  if (adhesive_) {
    overlap_ = std::make_unique<Overlap>(*model_);
    start_.contacts.overlapping = !overlap_->Find(start_.position_m).empty();
  }
  if (overlap_ || solver_->has_rows()) before_m_ = start_.position_m;
  zone_builder_->Rebuild(&start_.contacts, &report_);
  // Velocities that pins, rigid bodies or constraints do not permit end here, before the books are
  // opened.
  OpenLedgers(*model_, &start_);
  solver_->Capture(&start_, tool_impulse_);
  OpenLedgers(*model_, &start_);
  // Capacities first: copies have only their size.
  ZoneBuilder::Reserve(*model_, &state_.contacts);
  Restore(start_);
}

void Pipeline::Restore(const State& state) {
  state_ = state;
  frozen_ = false;
  has_forces_ = false;
  searched_ = edges_next_ = false;
  Forget();
  if (sleeping_) RestoreSleep();
}

void Pipeline::Forget() {
  solver_->Forget();
  if (implicit_) implicit_->Forget();
  if (force_error_) force_error_->Forget();
}

}  // namespace adhesim
