#include "core/model/diagnostics.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/model/volume.h"

namespace adhesim {
namespace {

double Relative(double error, double scale) { return error == 0 ? 0 : error / scale; }

// Whether one of the scene's effects preserves the volume of this body.
bool IsPreserved(const v1::Scene& scene, const Body& body) {
  if (!body.closed || body.rigid) return false;
  return std::any_of(scene.effects().begin(), scene.effects().end(), [&](const v1::Effect& effect) {
    if (!effect.has_volume_preservation()) return false;
    const auto& names = effect.volume_preservation().bodies();
    // Without names, tissue is left out.
    if (names.empty()) return body.tetrahedron_count == 0;
    return std::find(names.begin(), names.end(), body.name) != names.end();
  });
}

// What round-off alone moves: a scene whose momentum never exceeded it was at rest, and one noise
// over another says nothing.
double StillMomentum(const Model& model) {
  double mass = 0, size = 0;
  for (double m : model.mass_kg) mass += m;
  for (const Body& body : model.bodies) size = std::max(size, body.size_m);
  return 1e-12 * mass * size / model.dt_s;
}

}  // namespace

double EnergyReference(const Ledger& ledger) {
  return ledger.reference_j + ledger.abs_external_j + ledger.abs_tool_j;
}

double IdentityError(const Ledger& ledger) {
  return Relative(ledger.worst_j, EnergyReference(ledger));
}

MomentumError MomentumBalance(const Model& model, const State& state) {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  for (std::size_t i = 0; i < state.position_m.size(); ++i) {
    const Vec3 p = model.mass_kg[i] * state.velocity_m_s[i];
    linear += p;
    angular += state.position_m[i].cross(p);
  }
  const MomentumLedger& ledger = state.momentum;
  if (!(ledger.scale_linear > StillMomentum(model))) return {};
  return {Relative((linear - ledger.initial_linear - ledger.impulse_linear).norm(),
                   ledger.scale_linear),
          Relative((angular - ledger.initial_angular - ledger.impulse_angular).norm(),
                   ledger.scale_angular)};
}

std::optional<double> VolumeError(const Model& model, const State& state) {
  std::optional<double> worst;
  for (const Body& body : model.bodies) {
    if (!IsPreserved(model.scene, body)) continue;
    const double volume = EnclosedVolume(model, body, state.position_m);
    worst = std::max(worst.value_or(0),
                     std::abs(volume - body.rest_volume_m3) / std::abs(body.rest_volume_m3));
  }
  return worst;
}

}  // namespace adhesim
