#pragma once

#include <algorithm>
#include <cmath>

#include "core/engine/engine.h"
#include "core/model/diagnostics.h"

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

}  // namespace adhesim::test
