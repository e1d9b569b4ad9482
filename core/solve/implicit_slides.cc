// The part of the implicit solver that is about contacts that slide.

#include "core/solve/implicit_solver.h"

namespace adhesim {

ContactRows::Motion ImplicitSolver::MotionAt(std::span<const Padded> change_m_s,
                                             std::span<const RigidGroup> groups,
                                             const State& state) {
  for (std::size_t p = 0; p < velocity_m_s_.size(); ++p) {
    velocity_m_s_[p] = prescribed_m_s_[p].vec() + change_m_s[p].vec() + arc_m_s_[p];
  }
  groups_at_change_.assign(groups.begin(), groups.end());
  for (std::size_t z = 0; z < groups.size(); ++z) {
    const Zone& zone = state.contacts.zones[z];
    if (zone.holds_sleepers || groups[z].driven()) continue;
    groups_at_change_[z].Project(
        std::span(state.contacts.zone_members).subspan(zone.first, zone.count), state.position_m,
        model_.mass_kg, velocity_m_s_);
  }
  return {velocity_m_s_, groups_at_change_};
}

bool ImplicitSolver::CollectSlides(std::span<const RigidGroup> groups, double dt_s,
                                   const State& state) {
  if (!slides_.rows || !slides_.rows->possible()) return false;
  slides_.rows->Collect(state, MotionAt(change_m_s_, groups, state), slides_.tools, dt_s, true);
  return !slides_.rows->empty();
}

// Finds the impulses, and then what they leave of the equation with them as they are.
void ImplicitSolver::MeetSlides(std::span<const RigidGroup> groups, double target,
                                const State& state, Parallel* parallel, StepReport* report) {
  iterations_ +=
      slides_.rows->MeetWithin(state, MotionAt(change_m_s_, groups, state),
                               {&system_, &system_, change_m_s_, residual_ns_, round_off_,
                                effort_.tolerance, model_.max_iterations, parallel, report});
  const SubspaceSystem::Result result =
      system_.Solve(target, model_.max_iterations, change_m_s_, residual_ns_, parallel);
  iterations_ += result.iterations;
  if (!result.converged) report->bits |= kStepNotConverged;
}

}  // namespace adhesim
