#pragma once

#include <string>

namespace adhesim {

// A valid scene that uses most of what a scene can hold.
inline std::string SampleScene() {
  return R"yaml(# Two cells and a sheet, pressed by a needle.
name: sample
description: "Two cells: one rigid"
rate_hz: 1 kHz
seed: 7
integration: {stability_fraction: 0.25, max_substeps: 8}
bodies:
  - name: cell_a
    icosphere: {radius_m: 18 mm, subdivisions: 1}
    position_m: [0, 0, 0.05]
    mass_kg: 10 g
    velocity_m_s: [1 cm/s, 0, 0]
  - name: cell_b
    icosphere:
      radius_m: "0.018"
    rotation_deg: [0, 1.5 rad, 0]
    mass_kg: 1e-2
    kind: rigid
  - name: bed
    sheet: {length_m: 0.1, width_m: 0.1, columns: 5, rows: 6}
    mass_kg: 0.1
    kind: BODY_KIND_DEFORMABLE
    fixed:
      - border: true
      - ball: {centre_m: [0, 0, 0], radius_m: 1 cm}
      - half_space: {point_m: [0, 0, 0], normal: [0, 0, 2]}
tools:
  - name: needle
    needle: {length_m: 0.1}
    position_m: [0, 0, 0.2]
    adhesion: {normal_strength_pa: 3 kPa}
    trajectory:
      - {t_s: 0, position_m: [0, 0, 0.2]}
      - {t_s: 500 ms, position_m: [0, 0, 0.1], orientation_wxyz: [0.707, 0.707, 0, 0]}
  - name: lancet
    lancet: {}
    position_m: [1, 0, 0.2]
    coupling: {stiffness_n_m: 2 N/mm}
effects:
  - shape_memory: {bodies: [cell_a], stiffness_n_m: 20, form: centre}
  - shape_memory: {bodies: [bed], stiffness_n_m: 20, damping_n_s_m: 0.1 N*s/m}
  - volume_preservation:
  - uniform_gravity: {}
  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: 2}
  - drag: {rate_per_s: 0.5}
  - virtual_adhesive: {capture_distance_m: 2 mm, normal_strength_pa: 100}
)yaml";
}

}  // namespace adhesim
