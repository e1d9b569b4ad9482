#pragma once

#include <string>

namespace adhesim::test {

// A scene of six cells that spin at 1 rad/s while they are drawn together and let go again: zones
// form, grow, merge, split and break all the time.
inline const char* kChurningCells = R"(
rate_hz: 1000
bodies:
  - {name: a, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [ 0.75, 0.1, 0], angular_velocity_rad_s: [0, 0, 1]}
  - {name: b, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [-0.75, 0, 0.1], angular_velocity_rad_s: [0, 1, 0]}
  - {name: c, icosphere: {radius_m: 0.6}, mass_kg: 2, position_m: [0, 0.8, 0.75], angular_velocity_rad_s: [1, 0, 0]}
  - {name: d, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.1, -0.9, 0.7], angular_velocity_rad_s: [0, 0, -1]}
  - {name: e, icosphere: {radius_m: 0.6}, mass_kg: 0.5, position_m: [0, 0.7, -0.9], angular_velocity_rad_s: [0.6, 0.8, 0]}
  - {name: f, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0, -0.8, -0.8], angular_velocity_rad_s: [0, -1, 0]}
effects:
  - shape_memory: {stiffness_n_m: 60}
  - volume_preservation: {}
  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: 3, core_radius_m: 0.1}
  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 1.5, shear_strength_pa: 1}
)";

// The same cells, but they rub: contacts slide, stop, and break by chance.
inline std::string RubbingCells() {
  std::string scene = kChurningCells;
  const std::string strength = "normal_strength_pa: 1.5, shear_strength_pa: 1}";
  return scene.replace(scene.find(strength), strength.size(),
                       "normal_strength_pa: 1.5, shear_strength_pa: 0.2, friction_coefficient: "
                       "0.3, bell: {rate_per_s: 0.5, force_n: 1}}");
}

// A soft ball fixed at its bottom and a needle above it, with its trajectory and adhesion still to
// be written.
inline std::string NeedleScene(const std::string& needle) {
  return R"(
rate_hz: 1000
bodies:
  - name: organ
    icosphere: {radius_m: 0.05, subdivisions: 3}
    mass_kg: 0.5
    fixed: [half_space: {point_m: [0, 0, -0.03], normal: [0, 0, 1]}]
tools:
  - name: needle
    needle: {radius_m: 0.0015}
    position_m: [0.003, 0.002, 0.055]
)" + needle +
         R"(
effects:
  - shape_memory: {stiffness_n_m: 40, damping_n_s_m: 0.3}
  - volume_preservation: {}
  - drag: {rate_per_s: 5}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 100}
)";
}

inline constexpr const char* kPressAndPull = R"(
    adhesion: {normal_strength_pa: 6000}
    trajectory:
      - {t_s: 0.0, position_m: [0.003, 0.002, 0.055]}
      - {t_s: 0.2, position_m: [0.003, 0.002, 0.040]}
      - {t_s: 0.5, position_m: [0.003, 0.002, 0.040]}
      - {t_s: 1.1, position_m: [0.003, 0.002, 0.100]}
)";

}  // namespace adhesim::test
