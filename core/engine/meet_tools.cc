// The part of a sub-step in which tools feel the mass of what they take hold of.

#include <Eigen/Cholesky>

#include "core/engine/pipeline.h"

namespace adhesim {

Mat6 Pipeline::CarriedInertia(int t) const {
  Mat6 inertia = Mat6::Zero();
  ForEachCarried(t, [&](int p, const Vec3& r) {
    const Mat3 cross = CrossMatrix(r);
    const double m = model_->mass_kg[p];
    inertia.topLeftCorner<3, 3>() += m * Mat3::Identity();
    inertia.topRightCorner<3, 3>() -= m * cross;
    inertia.bottomLeftCorner<3, 3>() += m * cross;
    inertia.bottomRightCorner<3, 3>() -= m * cross * cross;
  });
  return inertia;
}

Vec6 Pipeline::CarriedMomentum(int t) const {
  Vec6 momentum = Vec6::Zero();
  ForEachCarried(t, [&](int p, const Vec3& r) {
    const Vec3 linear = model_->mass_kg[p] * state_.velocity_m_s[p];
    momentum.head<3>() += linear;
    momentum.tail<3>() += r.cross(linear);
  });
  return momentum;
}

// Capture is a plastic impact of tissue and tool, in which both keep their momentum together. A
// tool that went on as it was would give tissue of ten times its mass its own speed at once, by an
// impulse that neither its coupling nor its mass could exert.
void Pipeline::MeetTools() {
  for (int t = 0; t < static_cast<int>(state_.tools.size()); ++t) {
    const Mat6 carried = CarriedInertia(t);
    if (carried.isZero(0)) continue;
    ToolState& tool = state_.tools[t];
    const Mat6 own = ToolInertia(model_->tools[t], tool.pose);
    Vec6 twist;
    twist << tool.twist.linear_m_s, tool.twist.angular_rad_s;
    twist = (own + carried).ldlt().solve(own * twist + CarriedMomentum(t));
    capture_impulse_ns_[t] += own(0, 0) * (twist.head<3>() - tool.twist.linear_m_s).norm();
    tool.twist = {twist.head<3>(), twist.tail<3>()};
  }
}

// Bonds have changed: so do zones, and velocities fit them from now on. `meets_tools`: tools may
// have taken hold of something.
void Pipeline::RenewZones(bool meets_tools) {
  adhesive_->Tie(state_.position_m, &state_.contacts);
  zones_parted_ |= zone_builder_->Rebuild(&state_.contacts, &report_);
  if (meets_tools) MeetTools();
  if (sleeping_) sleeping_->MarkZones(&state_);
  solver_->Capture(&state_, tool_impulse_);
}

}  // namespace adhesim
