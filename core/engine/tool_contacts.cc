#include "core/engine/tool_contacts.h"

#include <algorithm>

namespace adhesim {

ToolContacts::ToolContacts(const Model& model, const ToolSet& tools)
    : model_(model), tools_(tools) {
  triangles_.reserve(model.triangles.size());
  near_.reserve(model.triangles.size() * model.tools.size());
}

std::span<const Adhesive::NearTool> ToolContacts::Find(const State& state, const Detector& detector,
                                                       std::span<const std::uint8_t> retracted,
                                                       double dt_s) {
  near_.clear();
  const double still = 1e-9 * model_.adhesive->capture_distance_m / dt_s;
  for (int tool = 0; tool < static_cast<int>(model_.tools.size()); ++tool) {
    if (retracted[tool]) continue;
    const ToolState& now = state.tools[tool];
    triangles_.clear();
    detector.QueryTriangles(tools_.Bounds(tool, now.pose).Grown(detector.reach_m()),
                            [&](int t) { triangles_.push_back(t); });
    std::sort(triangles_.begin(), triangles_.end());
    for (int t : triangles_) {
      const Triangle& tri = model_.triangles[t];
      if (model_.bodies[model_.body_of[tri[0]]].all_fixed) continue;
      ToolSet::Nearest nearest;
      if (!tools_.NearestOnTriangle(tool, now.pose, state.position_m[tri[0]],
                                    state.position_m[tri[1]], state.position_m[tri[2]],
                                    detector.reach_m(), &nearest)) {
        continue;
      }
      Vec3 velocity = -now.twist.linear_m_s -
                      now.twist.angular_rad_s.cross(nearest.point_m - now.pose.position_m);
      for (int k = 0; k < 3; ++k) velocity += nearest.weights(k) * state.velocity_m_s[tri[k]];
      near_.push_back({tool, t, nearest.weights, nearest.normal, nearest.distance_m,
                       nearest.normal.dot(velocity) < -still,
                       nearest.axial_m <= model_.tools[tool].sticky_length_m});
    }
  }
  return near_;
}

}  // namespace adhesim
