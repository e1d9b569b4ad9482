#include "core/study/accuracy_formula.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/scene/field_value.h"

namespace adhesim {
namespace {

constexpr double kShearFactor = 5.0 / 6;  // kappa of a rectangle
constexpr double kMostDeflection = 0.02;  // of the length: beyond, bending is no longer linear
constexpr double kOnFace = 1e-6;          // of the length

// The only effects that a beam at rest knows; drag brings it to rest.
struct BeamEffects {
  const v1::Elasticity* elasticity = nullptr;
  const v1::UniformGravity* gravity = nullptr;
  bool others = false;
};

BeamEffects EffectsOf(const v1::Scene& scene) {
  BeamEffects effects;
  for (const v1::Effect& effect : scene.effects()) {
    if (effect.has_elasticity() && effect.elasticity().regions().empty()) {
      effects.elasticity = &effect.elasticity();
    } else if (effect.has_uniform_gravity()) {
      effects.gravity = &effect.uniform_gravity();
    } else if (!effect.has_drag()) {
      effects.others = true;
    }
  }
  return effects;
}

// The particles held are those of the lower x face, all of them, and no others.
bool HeldAtItsFoot(const Model& model, double foot_m, double length_m) {
  for (int p = 0; p < model.particle_count(); ++p) {
    const bool on_foot = model.rest_position_m[p].x() <= foot_m + kOnFace * length_m;
    if (on_foot != (model.fixed[p] != 0)) return false;
  }
  return true;
}

}  // namespace

std::optional<BeamFormula> BeamOf(const Model& model) {
  const v1::Scene& scene = model.scene;
  if (scene.bodies_size() != 1 || !scene.bodies(0).has_block() || !model.tools.empty() ||
      model.tetrahedra.empty() || model.bodies.size() != 1) {
    return std::nullopt;
  }
  const BeamEffects effects = EffectsOf(scene);
  if (effects.others || effects.elasticity == nullptr || effects.gravity == nullptr) {
    return std::nullopt;
  }
  const Vec3 gravity = Vec3Of(*effects.gravity, "acceleration_m_s2");
  const Vec3 size = Vec3Of(scene.bodies(0).block(), "size_m");
  Aabb box;
  for (const Vec3& x : model.rest_position_m) box.Add(x);
  const double length = size.x();
  const bool turned = (box.max - box.min - size).norm() > kOnFace * length;
  if (turned || gravity.x() != 0 || gravity.y() != 0 || gravity.z() >= 0 ||
      length < 4 * std::max(size.y(), size.z()) || !HeldAtItsFoot(model, box.min.x(), length)) {
    return std::nullopt;
  }
  double mass_kg = 0;
  for (const double mass : model.mass_kg) mass_kg += mass;
  const double young = NumberOf(*effects.elasticity, "young_modulus_pa");
  const double shear = young / (2 * (1 + NumberOf(*effects.elasticity, "poisson_ratio")));
  const double load_n_m = -gravity.z() * mass_kg / length;
  const double area = size.y() * size.z();
  const double bending_n_m2 = young * size.y() * std::pow(size.z(), 3) / 12;
  BeamFormula formula;
  formula.deflection_m = load_n_m * (std::pow(length, 4) / (8 * bending_n_m2) +
                                     length * length / (2 * kShearFactor * shear * area));
  formula.text = "Timoshenko's beam under its own weight: w L^4 / 8EI + w L^2 / 2 kappa G A";
  if (formula.deflection_m > kMostDeflection * length) return std::nullopt;
  return formula;
}

double BeamEndDeflection(const Model& model, std::span<const Vec3> position_m) {
  const std::vector<Vec3>& rest = model.rest_position_m;
  double end_m = -std::numeric_limits<double>::infinity();
  for (const Vec3& x : rest) end_m = std::max(end_m, x.x());
  double sum = 0, area = 0;
  for (const Triangle& t : model.triangles) {
    const auto on_end = [&](int p) { return std::abs(rest[p].x() - end_m) < 1e-9; };
    if (!std::all_of(t.begin(), t.end(), on_end)) continue;
    const double part = (rest[t[1]] - rest[t[0]]).cross(rest[t[2]] - rest[t[0]]).norm() / 6;
    for (const int p : t) {
      sum += part * (rest[p].z() - position_m[p].z());
      area += part;
    }
  }
  return area > 0 ? sum / area : 0;
}

}  // namespace adhesim
