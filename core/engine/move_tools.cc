// The part of a sub-step in which tools move: to where their couplings pull them, against the
// tissue that they hold, as far as nothing is in the way.

#include <Eigen/Cholesky>

#include "core/engine/pipeline.h"

namespace adhesim {
namespace {

constexpr int kNotIntoSweeps = 16;  // over the points in the way; then the tool stops altogether
constexpr double kNotInto = 1e-6;   // of its speed

}  // namespace

// Once for every set of zones that a sub-step tries: a tool that was moved with what it then let
// go, or without what its tissue then stuck to, would be driven on against forces that it never
// felt.
void Pipeline::MoveTools(double dt_s) {
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    state_.tools[t].flags = tool_flags_[t];
    last_twist_[t] = state_.tools[t].twist;
  }
  const bool together = tool_system_ && StepsImplicitly() && MoveWithTissue(dt_s);
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    const int tool = static_cast<int>(t);
    if (!together || !tool_system_->has(tool)) FollowAgainstForces(tool, dt_s);
    tool_twist_[t] = NotIntoHeldTissue(tool, tool_twist_[t]);
  }
  KeepToolsApart(dt_s);
}

// One after the other: the next tool sees where this one will be, so that none can pass another.
void Pipeline::KeepToolsApart(double dt_s) {
  for (std::size_t t = 0; t < state_.tools.size(); ++t) tool_pose_[t] = state_.tools[t].pose;
  for (std::size_t t = 0; t < state_.tools.size(); ++t) {
    Twist& twist = tool_twist_[t];
    if (tools_can_collide_) twist = Unobstructed(static_cast<int>(t), twist, dt_s);
    tool_pose_[t] = Advance(state_.tools[t].pose, twist, dt_s);
  }
}

// The tool's next twist against the forces on what it carries at the start of the sub-step.
void Pipeline::FollowAgainstForces(int t, double dt_s) {
  ToolState& tool = state_.tools[t];
  // What the tool carries: the inertia of its zone, and the forces on it.
  const Mat6 inertia = ToolInertia(model_->tools[t], tool.pose) + CarriedInertia(t);
  Wrench applied = tool.rubbed;
  ForEachCarried(t, [&](int p, const Vec3& r) {
    applied.force_n += total_force_n_[p];
    applied.torque_nm += r.cross(total_force_n_[p]);
  });
  const CouplingResult result = FollowTarget(model_->tools[t].coupling, tool.pose, tool.twist,
                                             tool.target, inertia, applied, dt_s);
  if (result.force_limited) tool.flags |= kToolForceLimited;
  if (result.speed_limited) tool.flags |= kToolSpeedLimited;
  coupling_now_[t] = {dt_s * result.wrench.force_n, dt_s * result.wrench.torque_nm};
  tool_twist_[t] = result.twist;
}

// The next twists of the tools that hold implicit tissue or slide on it, with that tissue's answer
// to them in the same equation (ToolSystem). False where that makes no difference, and nothing is
// done.
bool Pipeline::MoveWithTissue(double dt_s) {
  const int tools = static_cast<int>(state_.tools.size());
  for (int t = 0; t < tools; ++t) {
    own_inertia_[t] = ToolInertia(model_->tools[t], state_.tools[t].pose);
  }
  solver_->FormGroups(state_, last_twist_);
  if (!tool_system_->Begin(state_, solver_->groups(), own_inertia_, dt_s, implicit_.get(),
                           &parallel_, solver_->sliding())) {
    return false;
  }
  const auto with_carried = [&](int t) -> Mat6 { return own_inertia_[t] + CarriedInertia(t); };
  const auto solve = [&] {
    for (int t = 0; t < tools; ++t) {
      const ToolState& tool = state_.tools[t];
      Vec6 twist;
      twist << tool.twist.linear_m_s, tool.twist.angular_rad_s;
      tool_law_[t] = {own_inertia_[t] + coupling_law_[t].resistance,
                      coupling_law_[t].impulse - coupling_law_[t].resistance * twist};
    }
    tool_system_->Solve(tool_law_, &report_, &parallel_);
  };
  const auto twist_of = [&](int t) -> Vec6 {
    Vec6 twist = tool_system_->change(t);
    twist.head<3>() += state_.tools[t].twist.linear_m_s;
    twist.tail<3>() += state_.tools[t].twist.angular_rad_s;
    return twist;
  };
  for (int t = 0; t < tools; ++t) {
    const ToolState& tool = state_.tools[t];
    coupling_law_[t] =
        LawOf(model_->tools[t].coupling, tool.pose, tool.target, with_carried(t), dt_s);
  }
  solve();
  bool any_limited = false;
  for (int t = 0; t < tools; ++t) {
    if (!tool_system_->has(t)) continue;
    bool limited = false;
    const Vec6 wrench =
        LimitWrench(model_->tools[t].coupling, twist_of(t), dt_s, &coupling_law_[t], &limited);
    if (limited) state_.tools[t].flags |= kToolForceLimited;
    any_limited = any_limited || limited;
    coupling_now_[t] = {dt_s * wrench.head<3>(), dt_s * wrench.tail<3>()};
  }
  if (any_limited) solve();
  for (int t = 0; t < tools; ++t) {
    if (!tool_system_->has(t)) continue;
    ToolState& tool = state_.tools[t];
    Vec6 before, twist = twist_of(t);
    before << tool.twist.linear_m_s, tool.twist.angular_rad_s;
    if (LimitTwist(model_->tools[t].coupling, tool.pose, tool.target, with_carried(t), before, dt_s,
                   &twist)) {
      tool.flags |= kToolSpeedLimited;
    }
    tool_twist_[t] = {twist.head<3>(), twist.tail<3>()};
  }
  // Where the step's own solve starts.
  const std::span<const Padded> change = tool_system_->change_m_s();
  for (std::size_t p = 0; p < change.size(); ++p) state_.velocity_change_m_s[p] = change[p].vec();
  return true;
}

// The twist without what drives the tool into tissue which it cannot take along, or what it holds
// into another tool: each point that is in the way gives an impulse there, along the normal, to the
// tool and what it carries. To stop it from turning, too, would be a torque that nothing exerts.
Twist Pipeline::NotIntoHeldTissue(int t, const Twist& aim) {
  if (near_tools_.empty()) return aim;
  ToolState& tool = state_.tools[t];
  Vec6 twist;
  twist << aim.linear_m_s, aim.angular_rad_s;
  const double nothing_m_s =
      kNotInto * (aim.linear_m_s.norm() + kSpeedRadius * aim.angular_rad_s.norm());
  const Eigen::LDLT<Mat6> inertia(ToolInertia(model_->tools[t], tool.pose) + CarriedInertia(t));
  for (int sweep = 0;; ++sweep) {
    bool stopped = false;
    for (const Adhesive::NearTool& near : near_tools_) {
      if (near.gap_m >= model_->adhesive->capture_distance_m) continue;
      if (near.tool == t ? !adhesive_->HeldAgainst(near, state_.contacts)
                         : !adhesive_->HeldBy(t, near, state_.contacts)) {
        continue;
      }
      const Vec3 ahead = near.tool == t ? near.normal : Vec3(-near.normal);
      Vec3 point = Vec3::Zero();
      for (int k = 0; k < 3; ++k) {
        point += near.weights(k) * state_.position_m[model_->triangles[near.triangle][k]];
      }
      Vec6 along;
      along << ahead, (point - tool.pose.position_m).cross(ahead);
      const double into = along.dot(twist);
      if (!(into > nothing_m_s)) continue;
      stopped = true;
      const Vec6 answer = inertia.solve(along);
      twist -= into / along.dot(answer) * answer;
      tool.flags |= kToolObstructed;
    }
    if (!stopped) break;
    if (sweep == kNotIntoSweeps) return {};
  }
  return {twist.head<3>(), twist.tail<3>()};
}

// Tissue that a tool cannot take along does not stand still for that: it turns about its pins, or
// bends. Where the trial step brings it to a tool, the tool gives way. True if any does.
bool Pipeline::GiveWay(double dt_s) {
  bool any = false;
  for (const Adhesive::NearTool& near : near_tools_) {
    const double nearer_m =
        adhesive_->ComesNearer(near, state_, solver_->moved_position_m(), tool_pose_[near.tool]);
    if (nearer_m == 0 || !adhesive_->HeldAgainst(near, state_.contacts)) continue;
    tool_twist_[near.tool].linear_m_s -= nearer_m / dt_s * near.normal;
    tool_pose_[near.tool] = Advance(state_.tools[near.tool].pose, tool_twist_[near.tool], dt_s);
    state_.tools[near.tool].flags |= kToolObstructed;
    any = true;
  }
  if (any) KeepToolsApart(dt_s);
  return any;
}

// The twist without the part that would drive the tool into an obstacle or another tool.
Twist Pipeline::Unobstructed(int t, Twist twist, double dt_s) {
  ToolState& tool = state_.tools[t];
  Vec3 normal;
  for (int attempt = 0; attempt < 3; ++attempt) {
    const double fraction =
        tool_set_->Sweep(t, tool.pose, Advance(tool.pose, twist, dt_s), tool_pose_, &normal);
    if (fraction >= 1) return twist;
    tool.flags |= kToolObstructed;
    const double into = twist.linear_m_s.dot(normal);
    if (attempt == 0 && into < 0) {
      twist.linear_m_s -= (1 - fraction) * into * normal;  // slide along it
    } else {
      twist = {twist.linear_m_s * fraction, twist.angular_rad_s * fraction};
    }
  }
  return {};
}

}  // namespace adhesim
