#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/effects/registry.h"
#include "tests/support/engine_fixture.h"

namespace adhesim::test {

// A block of tissue whose statics or motion a closed form tells. Its centre is at the origin.
struct TissueSample {
  Vec3 size_m = {0.1, 0.1, 0.1};
  int cells = 4;  // along the longest edge
  double young_modulus_pa = 5000;
  double poisson_ratio = 0.3;
  double density_kg_m3 = 1000;
  std::string law = "corotational";
  std::string fixed;             // YAML of regions, such as "[all: true]"
  std::string effects;           // YAML of further effects, a line each
  std::string bodies_and_tools;  // YAML of what else there is
  double dt_s = 0.005;
  double tolerance = 1e-11;  // of the solver: far below what discretisation leaves
  Integrator integrator = Integrator::kImplicit;

  // Its model, which the test may change (loads, pins) before it makes an engine.
  std::shared_ptr<Model> Make() const {
    const auto number = [](double value) {
      char text[40];
      std::snprintf(text, sizeof text, "%.17g", value);
      return std::string(text);
    };
    std::string yaml = "bodies:\n  - {name: tissue, block: {size_m: [" + number(size_m.x()) + ", " +
                       number(size_m.y()) + ", " + number(size_m.z()) +
                       "]}, tetrahedra: {cells: " + std::to_string(cells) +
                       "}, density_kg_m3: " + number(density_kg_m3);
    if (!fixed.empty()) yaml += ", fixed: " + fixed;
    yaml += "}\n" + bodies_and_tools +
            "effects:\n  - elasticity: {young_modulus_pa: " + number(young_modulus_pa) +
            ", poisson_ratio: " + number(poisson_ratio) + ", model: " + law + "}\n" + effects;
    const std::shared_ptr<const Model> built = ModelOf(yaml);
    if (!built) return nullptr;
    auto model = std::make_shared<Model>(*built);
    model->dt_s = dt_s;
    model->tolerance = tolerance;
    model->max_iterations = 100000;
    model->integrator = integrator;
    return model;
  }
};

// A step so long that backward Euler finds the statics at once: what moves with angular frequency w
// keeps 1 / (w dt) of its amplitude a step.
inline constexpr double kStaticStep_s = 30;

// Steps until nothing moves by more than `part` of the largest displacement in a step; returns what
// still moves, as that part.
inline double Settle(Engine* engine, double part = 1e-9, int most_steps = 40) {
  const Model& model = engine->model();
  double left = 1;
  for (int step = 0; step < most_steps && !(left <= part); ++step) {
    const std::vector<Vec3> before = engine->state().position_m;
    EXPECT_EQ(engine->Step({}).bits, 0u);
    double moved = 0, away = 0;
    for (int p = 0; p < model.particle_count(); ++p) {
      const Vec3& x = engine->state().position_m[p];
      moved = std::max(moved, (x - before[p]).norm());
      away = std::max(away, (x - model.rest_position_m[p]).norm());
    }
    left = moved / away;
  }
  EXPECT_LE(left, part);
  return left;
}

// Elastic forces where the particles are now.
inline std::vector<Vec3> ElasticForces(const Engine& engine) {
  const Model& model = engine.model();
  const std::size_t n = model.rest_position_m.size();
  auto effect = MakeEffect(model, model.scene.effects(0));
  EXPECT_TRUE(effect.ok());
  std::vector<double> state((*effect)->state_size());
  (*effect)->InitialState(state);
  std::vector<Vec3> force[kForceKinds];
  for (auto& f : force) f.assign(n, Vec3::Zero());
  Parallel one(1);
  (*effect)->AddForces({engine.state().position_m, engine.state().velocity_m_s, 0, state, &one, {}},
                       {force[0], force[1], force[2], force[3]});
  return force[0];
}

// The area of the plane {x : x[axis] = at} that belongs to each particle [#particles]: what a
// uniform traction there weighs its forces with.
inline std::vector<double> FaceAreas(const Model& model, int axis, double at_m) {
  std::vector<double> area(model.rest_position_m.size(), 0);
  const std::vector<Vec3>& x = model.rest_position_m;
  for (const Triangle& t : model.triangles) {
    const bool inside =
        std::all_of(t.begin(), t.end(), [&](int p) { return std::abs(x[p][axis] - at_m) < 1e-9; });
    if (!inside) continue;
    for (int p : t) area[p] += (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).norm() / 6;
  }
  return area;
}

// Mean displacement along an axis, by weights.
inline double MeanDisplacement(const Engine& engine, std::span<const double> weights, int axis) {
  double sum = 0, all = 0;
  for (std::size_t p = 0; p < weights.size(); ++p) {
    sum +=
        weights[p] * (engine.state().position_m[p][axis] - engine.model().rest_position_m[p][axis]);
    all += weights[p];
  }
  return sum / all;
}

// The power of h by which errors fall: the slope of log error over log h, least squares.
inline double FittedOrder(std::span<const double> h, std::span<const double> error) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  const double n = static_cast<double>(h.size());
  for (std::size_t k = 0; k < h.size(); ++k) {
    const double x = std::log(h[k]), y = std::log(std::abs(error[k]));
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

// The limit of three values on meshes of h, h/2 and h/4, and the order at which they go there
// (Richardson).
struct Limit {
  double value, order;
};
inline Limit RichardsonLimit(double coarse, double middle, double fine) {
  const double ratio = (coarse - middle) / (middle - fine);
  return {fine + (fine - middle) / (ratio - 1), std::log2(ratio)};
}

// Displacement of a half space's point (z < 0: inside) under a force down at the origin (Johnson,
// Contact Mechanics, 1985, eq. 3.18).
inline Vec3 Boussinesq(const Vec3& x, double force_n, double young_pa, double poisson) {
  const double shear_pa = young_pa / (2 * (1 + poisson));
  const double z = -x.z(), away = x.norm(), r = x.head<2>().norm();
  const double scale = force_n / (4 * M_PI * shear_pa * away);
  const double outward = scale * (r * z / (away * away) - (1 - 2 * poisson) * r / (away + z));
  const double down = scale * (z * z / (away * away) + 2 * (1 - poisson));
  const Eigen::Vector2d radial = r > 0 ? Eigen::Vector2d(x.head<2>() / r) : Eigen::Vector2d::Zero();
  return {outward * radial.x(), outward * radial.y(), -down};
}

// What a test measured, for its reader and for the test's XML.
inline void Tell(const std::string& what, double value) {
  std::printf("  %-44s %.6g\n", what.c_str(), value);
  testing::Test::RecordProperty(what, std::to_string(value));
}

}  // namespace adhesim::test
