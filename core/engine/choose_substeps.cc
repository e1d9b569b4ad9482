// How many sub-steps a step is made in: as many as contact needs to see what comes.

#include <cmath>

#include "core/engine/pipeline.h"
#include "core/model/awake.h"

namespace adhesim {
namespace {

// rad: how far a body of implicit tissue may turn as a whole in a sub-step that is planned, and in
// one that is found. Turns gain and lose in their square (decision 27).
constexpr double kTurnRad = 0.1;
constexpr double kMostTurnRad = 0.12;

// s: what lies in each other comes out by half a capture distance a sub-step, in long steps as fast
// as in short ones.
constexpr double kOverlapStepS = 0.005;

// s: what swings faster than once in this time does not set the length of its own steps.
constexpr double kKeptS = 0.1;

bool MeetsItself(const Model& model) { return model.adhesive && model.adhesive->self_collision; }

}  // namespace

// About the velocity that a tool's coupling leads to in this step, against the tissue's force of
// the last one. What the distance from the target alone says is of no use in long steps: a tool
// that presses lags behind its target without moving.
Twist Pipeline::ComingTwist(int t) const {
  const ToolState& tool = state_.tools[t];
  const CouplingParameters& coupling = model_->tools[t].coupling;
  const double dt_s = model_->dt_s, length_m = ToolLength(model_->tools[t]);
  const auto coming = [dt_s](const Vec3& velocity, const Vec3& error, const Vec3& force,
                             double stiffness, double inertia) -> Vec3 {
    const double time_s = std::sqrt(inertia / stiffness);  // of the critically damped spring
    return (time_s * time_s * velocity + dt_s * (error + force / stiffness)) /
           ((time_s + dt_s) * (time_s + dt_s));
  };
  const Quat turn = tool.target.orientation * tool.pose.orientation.conjugate();
  const Vec3 angle = (turn.w() < 0 ? -2.0 : 2.0) * turn.vec();
  return {coming(tool.twist.linear_m_s, tool.target.position_m - tool.pose.position_m,
                 tool.tissue.force_n, coupling.stiffness_n_m, coupling.mass_kg),
          coming(tool.twist.angular_rad_s, angle, tool.tissue.torque_nm,
                 coupling.angular_stiffness_nm_rad, coupling.mass_kg * length_m * length_m / 3)};
}

// Where tools go in the coming step, as far as that can be told before it.
Pipeline::ToolMotion Pipeline::ComingToolMotion() const {
  ToolMotion motion;
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    const ToolState& tool = state_.tools[t];
    const double limit = model_->tools[t].coupling.max_speed_m_s;
    motion.velocities.Add(tool.twist.linear_m_s);
    double turn = tool.twist.angular_rad_s.norm();
    if (implicit_) {
      const Twist coming = ComingTwist(static_cast<int>(t));
      motion.velocities.Add(
          Vec3(coming.linear_m_s * std::min(1.0, limit / coming.linear_m_s.norm())));
      turn = std::max(turn, std::min(limit / kSpeedRadius, coming.angular_rad_s.norm()));
    } else {
      const Vec3 away = (tool.target.position_m - tool.pose.position_m) / model_->dt_s;
      if (away.squaredNorm() > 0) {
        motion.velocities.Add(
            Vec3(away.normalized() * std::min(limit, tool.twist.linear_m_s.norm() + away.norm())));
      }
      const double angle =
          2 * (tool.target.orientation * tool.pose.orientation.conjugate()).vec().norm();
      turn = std::max(turn, std::min(limit / kSpeedRadius, turn + angle / model_->dt_s));
    }
    motion.turning_m_s = std::max(motion.turning_m_s, turn * ToolLength(model_->tools[t]));
  }
  return motion;
}

// In how many parts a time has to be cut so that nothing closes in by more than `most_m` in one; if
// that is no more than `enough`, about how many. Two things close in at most by the diagonal of the
// box around all velocities, whatever they have in common.
double Pipeline::PartsByClosing(double time_s, std::span<const Vec3> velocity_m_s,
                                const ToolMotion& tools, double most_m, double enough) {
  if (!detector_) return 0;
  Aabb velocities = tools.velocities;
  for (const auto& [begin, end] : AwakeRanges(model_->particle_count(), state_.sleep)) {
    for (int p = begin; p < end; ++p) velocities.Add(velocity_m_s[p]);
  }
  if (state_.sleep.bodies > 0) velocities.Add(Vec3(Vec3::Zero()));
  const double closing_m_s = (velocities.max - velocities.min).norm() + tools.turning_m_s;
  const double parts = closing_m_s * time_s / most_m;
  if (parts <= enough || !state_.tools.empty() || MeetsItself(*model_)) return parts;
  // Only what is within reach needs so many; the rest has further to go. ClosingSpeed() is of
  // pairs of bodies: tools, and a body that meets itself, keep to the box.
  detector_->Update(state_.position_m, &parallel_, &report_);
  const double per_m_s = time_s / most_m;
  const double near = per_m_s * detector_->ClosingSpeed(state_.position_m, velocity_m_s,
                                                        (1 - 1e-9) * enough / per_m_s);
  const double far = closing_m_s * time_s / (detector_->reach_m() - contact_distance_m_ + most_m);
  return near > far ? near : far;
}

// The same so that no implicit body turns by more than `most_rad` as a whole in one.
double Pipeline::PartsByTurning(double time_s, std::span<const Vec3> velocity_m_s,
                                double most_rad) const {
  return StepsImplicitly() ? time_s / most_rad * implicit_->FastestTurn(state_, velocity_m_s) : 0;
}

// At least what the elastic stability bound needs, and so many that nothing crosses half a capture
// distance in one, or turns far, as fast as things are now. Explicit springs conserve energy in
// steps of one length; one that follows their own motion swings with it and feeds it. So their
// number grows when it must, and falls when half of it has been enough for a while.
int Pipeline::SubstepsNow() {
  const double closing = PartsByClosing(model_->dt_s, state_.velocity_m_s, ComingToolMotion(),
                                        0.5 * contact_distance_m_, substeps_);
  slow_ = 2 * closing <= substeps_;
  const double turning = PartsByTurning(model_->dt_s, state_.velocity_m_s, kTurnRad);
  const double overlap = state_.contacts.overlapping ? model_->dt_s / kOverlapStepS : 0;
  const int needed =
      std::max({substeps_, Permitted(closing), Permitted(turning), Permitted(overlap)});
  if (!springs_) return needed;
  const double since_s =
      static_cast<double>(state_.step - state_.substeps_needed_in) * model_->dt_s;
  if (needed > state_.substeps || since_s > kKeptS) state_.substeps = needed;
  if (2 * needed > state_.substeps) state_.substeps_needed_in = state_.step;
  return state_.substeps;
}

// Whole sub-steps, as many as the step may still have.
int Pipeline::Permitted(double wanted) {
  const int most = model_->max_substeps - made_;
  if (!(wanted <= most)) report_.bits |= kStepSubstepLimit;
  // Not std::min: a NaN, which freezes the engine at the end of the step, must not reach the cast.
  return static_cast<int>(std::ceil(wanted <= most ? wanted : most));
}

void Pipeline::DivideRest(int substeps) {
  to_make_ = made_ + substeps;
  substep_dt_s_ = left_s_ / substeps;
}

// Whether the last trial closes in by more than what contact sees coming, or turns too far, though
// velocities at the start did not say so: what falls from rest. What is left of the step is then
// divided by the velocities that the trial ended with. Explicit steps are short already, and what
// their rows ask grows as the time gets shorter: 500 parts of one ended in no numbers.
bool Pipeline::MovesTooFar() {
  if (!StepsImplicitly()) return false;
  const std::span<const Vec3> velocity_m_s = solver_->moved_velocity_m_s();
  ToolMotion tools;
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    tools.velocities.Add(tool_twist_[t].linear_m_s);
    tools.turning_m_s = std::max(
        tools.turning_m_s, tool_twist_[t].angular_rad_s.norm() * ToolLength(model_->tools[t]));
  }
  // What lies half of that apart was seen and is looked at; lists of the sub-step before have seen
  // no more than that.
  const double half_m = 0.5 * contact_distance_m_, most_m = old_lists_ ? half_m : 2 * half_m;
  const bool alone = model_->bodies.size() == 1 && state_.tools.empty() && !MeetsItself(*model_);
  int substeps = 0;
  if (!alone && PartsByClosing(substep_dt_s_, velocity_m_s, tools, most_m, 1) > 1) {
    substeps = Permitted(PartsByClosing(left_s_, velocity_m_s, tools, half_m, 1));
  }
  if (PartsByTurning(substep_dt_s_, velocity_m_s, kMostTurnRad) > 1) {
    substeps = std::max(substeps, Permitted(PartsByTurning(left_s_, velocity_m_s, kTurnRad)));
  }
  if (substeps <= to_make_ - made_) return false;
  slow_ = false;
  DivideRest(substeps);
  return true;
}

}  // namespace adhesim
