#include "core/engine/freeze_cause.h"

#include <absl/strings/str_cat.h>

#include <cmath>

namespace adhesim {
namespace {

// Number within its body, as in the body's file.
std::string NameOf(const Model& model, int particle) {
  const Body& body = model.bodies[model.body_of[particle]];
  return absl::StrCat("particle ", particle - body.first_particle, " of body '", body.name, "'");
}

std::string When(const State& state) {
  return absl::StrCat(" after step ", state.step, " (", state.time_s, " s)");
}

}  // namespace

std::string WhyNotFinite(const Model& model, const State& state) {
  int first = -1, count = 0;
  for (int p = 0; p < model.particle_count(); ++p) {
    if (state.position_m[p].allFinite() && state.velocity_m_s[p].allFinite()) continue;
    if (count++ == 0) first = p;
  }
  if (count > 0) {
    const bool moved = !state.position_m[first].allFinite();
    const std::string more =
        count > 1 ? absl::StrCat(" (and ", count - 1, " more of ", model.particle_count(), ")")
                  : "";
    return absl::StrCat(moved ? "position" : "velocity", " of ", NameOf(model, first),
                        " is not finite", more, When(state));
  }
  for (std::size_t t = 0; t < state.tools.size(); ++t) {
    const ToolState& tool = state.tools[t];
    const bool placed = tool.pose.position_m.allFinite();
    if (placed && tool.tissue.force_n.allFinite()) continue;
    return absl::StrCat(placed ? "force on" : "position of", " tool '", model.tools[t].name,
                        "' is not finite", When(state));
  }
  if (!std::isfinite(state.ledger.kinetic_j)) {
    return absl::StrCat("kinetic energy is not finite, though every velocity is", When(state));
  }
  return "";
}

}  // namespace adhesim
