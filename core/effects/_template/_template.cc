#include "core/effects/_template/_template.h"

#include "core/effects/registry.h"

namespace adhesim {

// Everything that needs memory happens here: a step allocates nothing.
TemplateEffect::TemplateEffect(const Model& model, const v1::ShapeMemory& message)
    : stiffness_n_m_(message.stiffness_n_m()) {
  for (int b : SelectBodies(model, message.bodies(), [](const Body& b) { return !b.rigid; })) {
    const Body& body = model.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      for (int k = model.neighbour_start[p]; k < model.neighbour_start[p + 1]; ++k) {
        const int q = model.neighbours[k];
        if (q < p) continue;  // each edge once
        edges_.push_back({{p, q}, (model.rest_position_m[q] - model.rest_position_m[p]).norm()});
      }
    }
  }
  edge_energy_j_.resize(edges_.size());
}

double TemplateEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  double sum_j = 0;
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    const auto [i, j] = edges_[e].ends;
    const Vec3 d = in.position_m[j] - in.position_m[i];
    const double length_m = d.norm(), stretch_m = length_m - edges_[e].length_m;
    edge_energy_j_[e] = 0.5 * stiffness_n_m_ * stretch_m * stretch_m;
    sum_j += edge_energy_j_[e];
    if (!(length_m > 0)) continue;  // ends that coincide have no direction to part in
    const Vec3 force_n = stiffness_n_m_ * stretch_m / length_m * d;
    out.elastic[i] += force_n;
    out.elastic[j] -= force_n;
  }
  return sum_j;
}

void TemplateEffect::AddEnergies(std::span<double> energy_j) const {
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    for (int p : edges_[e].ends) energy_j[p] += 0.5 * edge_energy_j_[e];
  }
}

// |df_i/dx_i| <= k, and as much again for the other end.
void TemplateEffect::AddBounds(std::span<double> stiffness_n_m, std::span<double>) const {
  for (const Edge& edge : edges_) {
    for (int p : edge.ends) stiffness_n_m[p] += 2 * stiffness_n_m_;
  }
}

}  // namespace adhesim
