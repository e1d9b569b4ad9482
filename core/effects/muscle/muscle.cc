#include "core/effects/muscle/muscle.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/effects/registry.h"

namespace adhesim {

namespace {

// The edges of a body, each once, ascending: of its tetrahedra where it has some, else of its
// surface.
std::vector<std::pair<std::int32_t, std::int32_t>> EdgesOf(const Model& model, const Body& body) {
  std::vector<std::pair<std::int32_t, std::int32_t>> edges;
  if (body.tetrahedron_count == 0) {
    for (int i = body.first_particle; i < body.first_particle + body.particle_count; ++i) {
      for (int k = model.neighbour_start[i]; k < model.neighbour_start[i + 1]; ++k) {
        if (model.neighbours[k] > i) edges.emplace_back(i, model.neighbours[k]);
      }
    }
    return edges;
  }
  for (int t = body.first_tetrahedron; t < body.first_tetrahedron + body.tetrahedron_count; ++t) {
    for (const std::int32_t i : model.tetrahedra[t]) {
      for (const std::int32_t j : model.tetrahedra[t]) {
        if (j > i) edges.emplace_back(i, j);
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace

MuscleEffect::MuscleEffect(const Model& model, const v1::Muscle& message)
    : max_force_n_(message.max_force_n()) {
  const Vec3 direction = Vec3(message.direction().data()).normalized();
  for (const int b :
       SelectBodies(model, message.bodies(), [](const Body& body) { return !body.rigid; })) {
    for (const auto& [i, j] : EdgesOf(model, model.bodies[b])) {
      const Vec3 edge = model.rest_position_m[j] - model.rest_position_m[i];
      if (std::abs(edge.dot(direction)) >= message.least_cosine() * edge.norm()) {
        fibres_.push_back({i, j, edge.norm()});
      }
    }
  }
  for (const v1::Activation& moment : message.schedule()) {
    schedule_.push_back({moment.t_s(), moment.activation()});
  }
}

double MuscleEffect::ActivationAt(double time_s) const {
  if (schedule_.empty()) return 1;
  if (time_s <= schedule_.front().t_s) return schedule_.front().activation;
  if (time_s >= schedule_.back().t_s) return schedule_.back().activation;
  const auto after =
      std::upper_bound(schedule_.begin(), schedule_.end(), time_s,
                       [](double t_s, const Moment& moment) { return t_s < moment.t_s; });
  const Moment& from = *(after - 1);
  const double part = (time_s - from.t_s) / (after->t_s - from.t_s);
  return from.activation + part * (after->activation - from.activation);
}

double MuscleEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  const double active_force_n = ActivationAt(in.time_s) * max_force_n_;
  if (active_force_n <= 0) return 0;
  for (const Fibre& fibre : fibres_) {
    const Vec3 along = in.position_m[fibre.to] - in.position_m[fibre.from];
    const double length_m = along.norm();
    const double stretch = length_m / fibre.rest_length_m - 1;
    const double relation = 1 - 4 * stretch * stretch;
    if (!(relation > 0)) continue;  // length_m > 0 otherwise
    const Vec3 force = (active_force_n * relation / length_m) * along;
    out.field[fibre.from] += force;
    out.field[fibre.to] -= force;
  }
  return 0;
}

void MuscleEffect::AddBounds(std::span<double> stiffness_n_m, std::span<double>) const {
  for (const Fibre& fibre : fibres_) {
    // |df/dL| <= 4 F_max / L_0 along the fibre, f / L <= 2 F_max / L_0 across; a row has the same
    // of both ends.
    const double row_n_m = 2 * 4 * max_force_n_ / fibre.rest_length_m;
    stiffness_n_m[fibre.from] += row_n_m;
    stiffness_n_m[fibre.to] += row_n_m;
  }
}

}  // namespace adhesim
