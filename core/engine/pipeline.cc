#include "core/engine/pipeline.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "core/model/awake.h"
#include "core/model/carried.h"

namespace adhesim {
namespace {

constexpr int kReleasePasses = 8;     // releases of one sub-step; the rest waits for the next
constexpr int kCrossingPasses = 8;    // captures of what would pass through in one sub-step
constexpr double kJumpSeconds = 0.1;  // a target further than the tool goes in this time has jumped

}  // namespace

absl::StatusOr<std::unique_ptr<Engine>> Engine::Create(std::shared_ptr<const Model> model,
                                                       const Options& options) {
  return Pipeline::Compile(std::move(model), options);
}

StepReport Pipeline::Step(std::span<const ToolInput> tools) {
  if (frozen_) return {kStepNonFinite, 0, 0, state_.sleep.bodies};
  clock_.BeginStep();
  report_ = {};
  SetTargets(tools);
  std::fill(tool_impulse_.begin(), tool_impulse_.end(), Wrench{});
  std::fill(coupling_impulse_.begin(), coupling_impulse_.end(), Wrench{});
  std::fill(capture_impulse_ns_.begin(), capture_impulse_ns_.end(), 0);
  std::fill(error_bar_.begin(), error_bar_.end(), ForceError::Bar{});
  made_ = 0;
  left_s_ = model_->dt_s;
  DivideRest(SubstepsNow());
  while (made_ < to_make_) Substep();
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    const double per_s = 1 / model_->dt_s;
    state_.tools[t].tissue = {tool_impulse_[t].force_n * per_s, tool_impulse_[t].torque_nm * per_s};
    state_.tools[t].coupling = {coupling_impulse_[t].force_n * per_s,
                                coupling_impulse_[t].torque_nm * per_s};
  }
  has_forces_ = true;
  report_.sleeping = state_.sleep.bodies;
  ++state_.step;
  state_.time_s = static_cast<double>(state_.step) * model_->dt_s;
  if (!Finite()) {
    frozen_ = true;
    report_.bits |= kStepNonFinite;
  }
  clock_.Lap(book_stage_);
  clock_.EndStep();
  return report_;
}

void Pipeline::SetTargets(std::span<const ToolInput> tools) {
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    ToolState& tool = state_.tools[t];
    const ToolModel& model = model_->tools[t];
    const ToolInput input = t < tools.size() ? tools[t] : ToolInput{};
    tool.flags = 0;
    strength_scale_[t] = input.strength_scale;
    retracted_[t] = input.retracted;
    if (input.retracted) tool.flags |= kToolRetracted;
    const Pose before = tool.target;
    if (input.has_target) {
      tool.target = input.target;
    } else if (!model.trajectory.empty()) {
      tool.target = PoseAt(model.trajectory, state_.time_s + model_->dt_s);
    }
    const double turned =
        2 * (tool.target.orientation * before.orientation.conjugate()).vec().norm();
    if ((tool.target.position_m - before.position_m).norm() + kSpeedRadius * turned >
        kJumpSeconds * model.coupling.max_speed_m_s) {
      tool.flags |= kToolTargetJumped;
    }
  }
}

void Pipeline::Substep() {
  if (state_.contacts.overlapping && overlap_) Separate();
  if (!implicit_ && solver_->rows_off()) RegainVolumes();
  if (detector_) DetectAndCapture(substep_dt_s_);
  EvaluateForces();
  if (sleeping_ && made_ == 0) {
    FallAsleep();
    clock_.Lap(sleep_stage_);
  }
  while (!TrySubstep(substep_dt_s_)) continue;
  const double dt_s = substep_dt_s_;
  if (force_error_ && StepsImplicitly()) BoundToolForces(dt_s);
  BookStep(*model_, {force_n_[0], force_n_[1], force_n_[2], force_n_[3]}, total_force_n_, *solver_,
           tool_twist_, dt_s, &state_, tool_impulse_);
  solver_->Accept(&state_, dt_s);
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    ToolState& tool = state_.tools[t];
    coupling_impulse_[t].force_n += coupling_now_[t].force_n;
    coupling_impulse_[t].torque_nm += coupling_now_[t].torque_nm;
    tool.twist = tool_twist_[t];
    tool.pose.position_m += dt_s * tool.twist.linear_m_s;
    tool.pose.orientation =
        (RotationStep(tool.twist.angular_rad_s, dt_s) * tool.pose.orientation).normalized();
  }
  EndSliding();  // zones that tools hold are where the tools are now
  ++made_;
  left_s_ -= dt_s;
  clock_.Lap(book_stage_);
}

// From the forces to where they lead. False: too far, and what is left of the step is divided anew.
bool Pipeline::TrySubstep(double dt_s) {
  const std::uint32_t bits = report_.bits;
  for (std::size_t t = 0; t < state_.tools.size(); ++t) tool_flags_[t] = state_.tools[t].flags;
  if (StepsImplicitly()) {
    implicit_->Begin(state_, near_, AllForces(), dt_s, &parallel_);
    clock_.Lap(solve_stage_);
  }
  if (tool_set_) {
    MoveTools(dt_s);
    clock_.Lap(tools_stage_);
  }
  const bool found = Solve(dt_s);
  clock_.Lap(solve_stage_);
  if (found) return true;
  report_.bits = bits;
  for (std::size_t t = 0; t < state_.tools.size(); ++t) state_.tools[t].flags = tool_flags_[t];
  implicit_->GiveBack(AllForces());
  return false;
}

void Pipeline::DetectAndCapture(double dt_s) {
  detector_->Update(state_.position_m, &parallel_, &report_);
  if (sleeping_) Wake();
  const Search search = NextSearch();
  if (search.particles) near_ = detector_->Find(state_.position_m, &parallel_);
  if (search.edges) FindNearEdges();
  clock_.Lap(detect_stage_);
  if (!adhesive_) return;
  if (search.particles) {
    near_ = adhesive_->TellInside(near_, state_.position_m, &state_.contacts);
  }
  int changes = state_.contacts.overlapping ? Adhesive::DropInside(&state_.contacts) : 0;
  changes += adhesive_->FollowSliding(near_, state_.time_s, &state_.contacts);
  changes += adhesive_->Capture(near_, near_edges_, state_, dt_s, &state_.contacts, &report_);
  if (tool_contacts_) {
    for (std::size_t t = 0; t < state_.tools.size(); ++t) {
      if (retracted_[t]) changes += adhesive_->ReleaseTool(static_cast<int>(t), &state_.contacts);
    }
    near_tools_ = tool_contacts_->Find(state_, *detector_, retracted_, dt_s);
    changes += adhesive_->FollowSlidingOnTools(near_tools_, state_, &state_.contacts);
    changes += adhesive_->CaptureByTools(near_tools_, state_, &state_.contacts, &report_);
  }
  if (changes > 0) RenewZones(/*meets_tools=*/true);
  clock_.Lap(zones_stage_);
  if (strengths_scale_) ScaleStrengths();
}

void Pipeline::EndSliding() {
  if (solver_->slid().empty()) return;
  for (const ContactRows::Verdict& verdict : solver_->slid()) {
    adhesive_->EndSliding(verdict.bond, verdict.outcome == ContactRows::Outcome::kSticks,
                          verdict.outcome == ContactRows::Outcome::kParts, &state_.contacts);
  }
  const int parted = adhesive_->RemoveParted(&state_.contacts);
  report_.releases += parted;
  if (parted > 0) RenewZones(/*meets_tools=*/false);
}

// Bodies that lie in each other since the start come apart, a little in every sub-step.
void Pipeline::Separate() {
  if (sleeping_ && state_.sleep.bodies > 0) {
    sleeping_->WakeAll(&state_);
    Forget();
  }
  state_.contacts.overlapping = !overlap_->Find(state_.position_m).empty();
  if (!state_.contacts.overlapping) return;
  report_.bits |= kStepOverlap;
  EvaluateForces();  // closes the books of what led here
  before_m_ = state_.position_m;
  overlap_->Separate(0.5 * contact_distance_m_, state_.position_m);
  solver_->CorrectPositions(state_.position_m);
  BookCorrection(*model_, before_m_, AddAllForces(), &state_);
  // Zones and volumes have another shape now: what velocities do not fit them ends.
  solver_->Capture(&state_, tool_impulse_);
}

// What has lost its volume gets it back, a little in every sub-step.
void Pipeline::RegainVolumes() {
  if (!solver_->RowsLack(state_)) return;
  report_.bits |= kStepVolumeNotMet;
  EvaluateForces();  // closes the books of what led here
  before_m_ = state_.position_m;
  const double most_m = detector_ ? 0.5 * contact_distance_m_ : HUGE_VAL;
  solver_->RegainRows(most_m, &state_);
  BookCorrection(*model_, before_m_, AddAllForces(), &state_);
}

double Pipeline::AddAllForces() {
  for (const auto& [begin, end] : AwakeRanges(model_->particle_count(), state_.sleep)) {
    for (auto& force : force_n_) {
      if (!force.empty()) std::fill(force.begin() + begin, force.begin() + end, Vec3::Zero());
    }
  }
  std::fill(implicit_damping_n_.begin(), implicit_damping_n_.end(), Vec3::Zero());
  const ForceOutput out{force_n_[0], force_n_[1], force_n_[2], force_n_[3]};
  double elastic_j = state_.sleep.elastic_j;
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    if (effects_[e]->force_kinds() == 0) continue;
    ForceInput in{
        state_.position_m,
        state_.velocity_m_s,
        state_.time_s,
        std::span(state_.effect_state).subspan(effect_state_first_[e], effects_[e]->state_size()),
        &parallel_,
        near_};
    in.asleep = state_.sleep.asleep;
    ForceOutput to = out;
    if (IsImplicit(*effects_[e])) to.damping = implicit_damping_n_;
    elastic_j += effects_[e]->AddForces(in, to);
    clock_.Lap(effect_stage_[e]);
  }
  if (!model_->carried.empty()) {
    for (auto& force : force_n_) {
      if (!force.empty()) GiveToCarriers(*model_, force);
    }
  }
  return elastic_j;
}

void Pipeline::EvaluateForces() {
  BookElastic(AddAllForces(), &state_);
  for (const auto& [begin, end] : AwakeRanges(model_->particle_count(), state_.sleep)) {
    std::fill(total_force_n_.begin() + begin, total_force_n_.begin() + end, Vec3::Zero());
    for (const auto& force : force_n_) {
      for (int p = begin; p < end && !force.empty(); ++p) total_force_n_[p] += force[p];
    }
  }
}

void Pipeline::BoundToolForces(double dt_s) {
  force_error_->Update(state_, solver_->groups(), dt_s, implicit_.get(), &parallel_);
  const double share = dt_s / model_->dt_s;
  for (std::size_t t = 0; t < error_bar_.size(); ++t) {
    const ForceError::Bar& bar = force_error_->bars()[t];
    if (!bar.known) continue;
    error_bar_[t] = {true, error_bar_[t].force_n + share * bar.force_n,
                     error_bar_[t].torque_nm + share * bar.torque_nm, bar.stiffness_n_m};
  }
  clock_.Lap(error_stage_);
}

// Until nothing lets go any more, and then until nothing passes through anything: what is caught
// then holds until the next sub-step. False as soon as a trial moves too far for that.
bool Pipeline::Solve(double dt_s) {
  int passes = 0, caught = 0;
  for (bool releasing = true;;) {
    solver_->FormGroups(state_, tool_twist_);
    std::span<const double> multipliers;
    const bool implicit = StepsImplicitly();
    if (implicit) {
      implicit_->Solve(solver_->groups(), dt_s, &state_, AllForces(), &parallel_, &report_,
                       solver_->sliding());
      multipliers = implicit_->row_multipliers();
    }
    solver_->Try(state_, total_force_n_, dt_s, &parallel_, &report_, multipliers, implicit);
    if (MovesTooFar()) return false;
    if (!adhesive_) return true;
    int changes = 0;
    if (releasing && passes < kReleasePasses) {
      changes = adhesive_->Release(solver_->load_n(), solver_->tie_load(), state_, strength_scale_,
                                   passes == 0 ? dt_s : 0, &state_.contacts);
      report_.releases += changes;
      if (++passes == kReleasePasses && changes > 0) report_.bits |= kStepReleasePasses;
    }
    if (changes == 0) {
      releasing = false;
      if (zones_parted_) FindNearEdges();  // those that moved as one are looked at too
      changes = adhesive_->CaptureCrossing(near_, near_edges_, state_, solver_->moved_position_m(),
                                           &state_.contacts, &report_);
      if (tool_contacts_) {
        changes +=
            adhesive_->CaptureCrossingByTools(near_tools_, state_, solver_->moved_position_m(),
                                              tool_pose_, &state_.contacts, &report_);
      }
      if (changes == 0) {
        if (!tool_contacts_ || ++caught > kCrossingPasses || !GiveWay(dt_s)) return true;
        continue;
      }
      if (++caught > kCrossingPasses) {
        report_.bits |= kStepReleasePasses;
        return true;
      }
    }
    RenewZones(!releasing);  // letting go changes no velocity, only the zones' own momenta
    if (tool_set_) {         // they go with what they hold now, and have met what was caught
      if (implicit) implicit_->GiveBack(AllForces());
      MoveTools(dt_s);
    }
  }
}

bool Pipeline::Finite() const {
  double sum = state_.ledger.kinetic_j;
  for (const auto& [begin, end] : AwakeRanges(model_->particle_count(), state_.sleep)) {
    for (int p = begin; p < end; ++p) sum += state_.position_m[p].sum();
  }
  for (const ToolState& tool : state_.tools)
    sum += tool.pose.position_m.sum() + tool.tissue.force_n.sum();
  return std::isfinite(sum);
}

Frame Pipeline::MakeFrame() const {
  Frame frame = frame_writer_->Make();
  WriteFrame(&frame);
  return frame;
}

void Pipeline::WriteFrame(Frame* frame) const {
  frame->report = report_;
  frame_writer_->Write(state_, frame);
  if (has_forces_) frame_writer_->WriteForces(state_, solver_->load_n(), error_bar_, frame);
}

}  // namespace adhesim
