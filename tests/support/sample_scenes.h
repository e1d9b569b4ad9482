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

// Two blocks of tissue that fly into each other, stick, swing, and are torn apart by their motion.
// More effects may follow.
inline constexpr const char* kCollidingBlocks = R"(
rate_hz: 200
bodies:
  - name: left
    block: {size_m: [0.04, 0.04, 0.04]}
    tetrahedra: {cells: 3}
    density_kg_m3: 1000
    position_m: [-0.023, 0.004, 0]
    velocity_m_s: [0.4, 0, 0]
  - name: right
    block: {size_m: [0.04, 0.04, 0.04]}
    tetrahedra: {cells: 4}
    density_kg_m3: 1000
    position_m: [0.023, -0.004, 0.003]
    velocity_m_s: [-0.4, 0, 0.1]
effects:
  - elasticity: {young_modulus_pa: 3000, poisson_ratio: 0.4}
  - virtual_adhesive: {capture_distance_m: 0.002, normal_strength_pa: 150, shear_strength_pa: 150}
)";

// A ball of tissue on a fixed floor under a plate that falls on it and crushes it to a third (0.3
// kg; some forty of its tetrahedra turn inside out), or rests on it and swings (0.03 kg). More
// effects may follow.
inline std::string PressedBall(double plate_kg, const std::string& integrator) {
  return "rate_hz: 200\nintegration: {integrator: " + integrator + R"(}
bodies:
  - name: ball
    icosphere: {radius_m: 0.03, subdivisions: 2}
    tetrahedra: {cells: 5}
    density_kg_m3: 1000
    position_m: [0, 0, 0.0305]
  - name: floor
    sheet: {length_m: 0.2, width_m: 0.2, columns: 9, rows: 9}
    mass_kg: 1
    fixed: [all: true]
  - name: plate
    kind: rigid
    block: {size_m: [0.08, 0.08, 0.02], cells: 4}
    mass_kg: )" +
         std::to_string(plate_kg) + R"(
    position_m: [0, 0, 0.0715]
effects:
  - elasticity: {young_modulus_pa: 5000, poisson_ratio: 0.2}
  - uniform_gravity: {}
  - virtual_adhesive: {capture_distance_m: 0.001, normal_strength_pa: 1000}
)";
}

// A beam of one layer, bent by its weight by 0.7 mm and braked. The solver leaves nothing that an
// error in dt could hide in; explicit steps need several sub-steps and are given one.
inline std::string BeamScene(
    const std::string& elasticity = "young_modulus_pa: 1e6, poisson_ratio: 0.3") {
  return R"(rate_hz: 400  # kept
integration: {max_substeps: 1, tolerance: 1e-8}
bodies:
  - name: beam
    block: {size_m: [0.4, 0.05, 0.05]}
    tetrahedra: {cells: 8}
    density_kg_m3: 1000
    fixed: [half_space: {point_m: [-0.19999, 0, 0], normal: [1, 0, 0]}]
effects:
  - elasticity: {)" +
         elasticity + R"(}
  - uniform_gravity: {acceleration_m_s2: [0, 0, -0.075]}
  - drag: {rate_per_s: 12}
)";
}

}  // namespace adhesim::test
