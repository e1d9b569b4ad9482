#include "core/effects/contact_effect.h"

#include <algorithm>
#include <limits>

namespace adhesim {

ContactEffect::ContactEffect(const Model& model)
    : model_(model), energy_j_(model.rest_position_m.size(), 0) {}

void ContactEffect::AddEnergies(std::span<double> energy_j) const {
  for (std::size_t p = 0; p < energy_j_.size(); ++p) energy_j[p] += energy_j_[p];
}

void ContactEffect::BeginEvaluation() const { std::fill(energy_j_.begin(), energy_j_.end(), 0); }

Vec3 ContactEffect::AtPoint(int triangle, const Vec3& weights, std::span<const Vec3> at) const {
  const Triangle& tri = model_.triangles[triangle];
  return weights(0) * at[tri[0]] + weights(1) * at[tri[1]] + weights(2) * at[tri[2]];
}

void ContactEffect::AddPair(int particle, int triangle, const Vec3& weights, const Vec3& force_n,
                            std::span<Vec3> force) const {
  force[particle] += force_n;
  for (int k = 0; k < 3; ++k) force[model_.triangles[triangle][k]] -= weights(k) * force_n;
}

void ContactEffect::AddPairBounds(double pair, std::span<double> row_sum) const {
  std::vector<double> mean_area_m2;
  for (const Body& body : model_.bodies) {
    double sum = 0;
    for (int k = 0; k < body.particle_count; ++k) sum += model_.area_m2[body.first_particle + k];
    mean_area_m2.push_back(sum / body.particle_count);
  }
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    double other_m2 = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < model_.bodies.size(); ++c) {
      if (c != b) other_m2 = std::min(other_m2, mean_area_m2[c]);
    }
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      row_sum[p] += 2 * pair * (1 + model_.area_m2[p] / other_m2);
    }
  }
}

}  // namespace adhesim
