#pragma once

#include <memory>

#include "tests/support/tet_block.h"

namespace adhesim::test {

// A cube of 10 cm of tissue (5 kPa), its bottom fixed, under a blunt needle that comes down in the
// middle of the top, presses, wanders sideways and pulls up until it lets go.
struct PressedBlock {
  int cells = 7;  // along each edge; 6 tetrahedra each
  double dt_s = 5e-3;
  double young_modulus_pa = 5000;
  double gravity_m_s2 = 0;
  double stiffness_damping_s = 0;
  double tolerance = 0.01;
  Integrator integrator = Integrator::kImplicit;
};

inline std::shared_ptr<Model> ModelOf(const PressedBlock& pressed) {
  TetBlock block;
  block.cells = {pressed.cells, pressed.cells, pressed.cells};
  block.size_m = {0.1, 0.1, 0.1};
  block.six_a_cell = true;
  block.density_kg_m3 = 1060;
  block.young_modulus_pa = pressed.young_modulus_pa;
  block.poisson_ratio = 0.45;
  block.stiffness_damping_s = pressed.stiffness_damping_s;
  std::shared_ptr<Model> model = ModelOf(block);
  model->dt_s = pressed.dt_s;
  model->integrator = pressed.integrator;
  model->tolerance = pressed.tolerance;
  model->max_iterations = 5000;
  for (int p = 0; p < model->particle_count(); ++p) {
    model->fixed[p] = model->rest_position_m[p].z() < 1e-9;
  }
  if (pressed.gravity_m_s2 > 0) {
    auto* acceleration = model->scene.add_effects()->mutable_uniform_gravity();
    for (const double g : {0.0, 0.0, -pressed.gravity_m_s2}) acceleration->add_acceleration_m_s2(g);
  }
  AdhesiveParameters adhesive;
  adhesive.capture_distance_m = 1e-3;
  adhesive.release_distance_m = 1.5e-3;
  model->adhesive = adhesive;
  ToolModel tool;
  tool.name = "probe";
  tool.shape = NeedleShape{0.1, 0.012, 0.012};
  const auto at = [](double x, double y, double z) {
    return Pose{Vec3(x, y, z), Quat::Identity()};
  };
  tool.start = at(0.051, 0.049, 0.103);
  tool.strength = {800, 800};
  tool.trajectory = {{0.0, tool.start},
                     {0.3, at(0.051, 0.049, 0.092)},
                     {0.5, at(0.051, 0.049, 0.092)},
                     {0.8, at(0.056, 0.046, 0.094)},
                     {1.3, at(0.056, 0.046, 0.125)}};
  model->tools.push_back(tool);
  return model;
}

}  // namespace adhesim::test
