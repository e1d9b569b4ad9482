#pragma once

#include <ostream>
#include <span>
#include <string>
#include <string_view>

namespace adhesim::test {

// A line of an effect's samples.txt: what the effect is tried on, and its message as a scene names
// it.
//   ball       one ball of 162 particles that moves and turns
//   two_balls  a second one comes and touches it; they start 0.25 m apart, further than any sample
//              reaches
//   glued      the same, with a virtual adhesive between them
//   block      a block of tetrahedra that moves and turns
struct EffectSample {
  std::string_view folder;  // of the effect, below core/effects
  std::string_view on;
  std::string_view message;  // YAML

  std::string_view name() const { return message.substr(0, message.find(':')); }
  bool contact() const { return on == "two_balls" || on == "glued"; }
};

inline void PrintTo(const EffectSample& sample, std::ostream* out) { *out << sample.message; }

// Those of the folders that the program was built with: adhesim_effect_samples() writes them.
std::span<const EffectSample> EffectSamples();

// The scene of a sample, its effect the first. A block is made by hand (TetBlock): its scene has
// the ball for its place.
inline std::string SceneOf(const EffectSample& sample) {
  std::string scene =
      "bodies:\n  - name: ball\n    icosphere: {radius_m: 0.5, subdivisions: 2}\n"
      "    mass_kg: 1.5\n    velocity_m_s: [0.1, 0.2, 0.3]\n"
      "    angular_velocity_rad_s: [0.5, -1, 0.7]\n";
  if (sample.contact()) {
    scene +=
        "  - name: other\n    icosphere: {radius_m: 0.5, subdivisions: 2}\n    mass_kg: 1.5\n"
        "    position_m: [1.25, 0.04, 0.02]\n    velocity_m_s: [-4, 0, 0]\n";
  }
  scene += "effects:\n  - " + std::string(sample.message) + "\n";
  if (sample.on == "glued") {
    scene += "  - virtual_adhesive: {capture_distance_m: 0.1, normal_strength_pa: 20}\n";
  }
  return scene;
}

}  // namespace adhesim::test
