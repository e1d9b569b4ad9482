#pragma once

#include <string>

namespace adhesim::test {

struct DraggedBar {
  double start_x_m, start_z_m, pressed_z_m;  // of the tip; the axis is 3 cm above the surface
  double friction, normal_pa = 0, shear_pa = 0;
};

// The tools of a scene: a bar along x that comes down until 0.2 s, presses, and is dragged along
// itself by 5 cm a second from 0.3 s on. It is so long that its ends need not touch.
inline std::string ToolsOf(const DraggedBar& bar) {
  const auto at = [](double t_s, double x_m, double z_m) {
    return "      - {t_s: " + std::to_string(t_s) + ", position_m: [" + std::to_string(x_m) +
           ", 0, " + std::to_string(z_m) + "]}\n";
  };
  return "tools:\n"
         "  - name: bar\n"
         "    needle: {length_m: 0.4, radius_m: 0.03, tip_length_m: 0.02}\n"
         "    position_m: [" +
         std::to_string(bar.start_x_m) + ", 0, " + std::to_string(bar.start_z_m) +
         "]\n"
         "    orientation_wxyz: [0.70710678118654757, 0, 0.70710678118654757, 0]\n"
         "    coupling: {stiffness_n_m: 2000, mass_kg: 0.05}\n"
         "    adhesion: {normal_strength_pa: " +
         std::to_string(bar.normal_pa) + ", shear_strength_pa: " + std::to_string(bar.shear_pa) +
         ", friction_coefficient: " + std::to_string(bar.friction) +
         "}\n"
         "    trajectory:\n" +
         at(0, bar.start_x_m, bar.start_z_m) + at(0.2, bar.start_x_m, bar.pressed_z_m) +
         at(0.3, bar.start_x_m, bar.pressed_z_m) + at(1.3, bar.start_x_m + 0.05, bar.pressed_z_m);
}

}  // namespace adhesim::test
