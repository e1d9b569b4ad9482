#include "core/effects/elastic_links/elastic_links.h"

#include <algorithm>

namespace adhesim {
namespace {

int TriangleOf(std::span<const double> link) { return static_cast<int>(link[0]); }
Vec3 WeightsOf(std::span<const double> link) { return {link[1], link[2], link[3]}; }

}  // namespace

ElasticLinksEffect::ElasticLinksEffect(const Model& model, const v1::ElasticLinks& message)
    : ContactEffect(model),
      capture_distance_m_(message.capture_distance_m()),
      rest_length_m_(message.rest_length_m()),
      max_length_m_(message.max_length_m()),
      stiffness_n_m_(message.stiffness_n_m()) {}

void ElasticLinksEffect::InitialState(std::span<double> state) const {
  std::fill(state.begin(), state.end(), 0);
  for (std::size_t k = 0; k < state.size(); k += kNumbers) state[k] = -1;
}

double ElasticLinksEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  BeginEvaluation();
  Remove(in);
  Create(in);
  double sum_j = 0;
  for (int p = 0; p < model_.particle_count(); ++p) {
    const auto link = in.effect_state.subspan(kNumbers * p, kNumbers);
    const int triangle = TriangleOf(link);
    if (triangle < 0) continue;
    const Vec3 weights = WeightsOf(link);
    const Vec3 offset = in.position_m[p] - AtPoint(triangle, weights, in.position_m);
    const double length_m = offset.norm();
    const double stretch_m = length_m - rest_length_m_;
    energy_j_[p] = 0.5 * stiffness_n_m_ * stretch_m * stretch_m;
    sum_j += energy_j_[p];
    if (length_m <= 0) continue;  // no direction
    AddPair(p, triangle, weights, (-stiffness_n_m_ * stretch_m / length_m) * offset, out.elastic);
  }
  return sum_j;
}

void ElasticLinksEffect::Remove(const ForceInput& in) const {
  for (int p = 0; p < model_.particle_count(); ++p) {
    const auto link = in.effect_state.subspan(kNumbers * p, kNumbers);
    if (TriangleOf(link) < 0) continue;
    const Vec3 q = AtPoint(TriangleOf(link), WeightsOf(link), in.position_m);
    if ((in.position_m[p] - q).squaredNorm() > max_length_m_ * max_length_m_) link[0] = -1;
  }
}

// Pairs are ascending by particle: the nearest body of each that has no link (the first of several
// as near).
void ElasticLinksEffect::Create(const ForceInput& in) const {
  for (std::size_t k = 0; k < in.near.size();) {
    const NearPair* nearest = &in.near[k];
    for (++k; k < in.near.size() && in.near[k].particle == nearest->particle; ++k) {
      if (in.near[k].gap_m < nearest->gap_m) nearest = &in.near[k];
    }
    const auto link = in.effect_state.subspan(kNumbers * nearest->particle, kNumbers);
    if (TriangleOf(link) >= 0 || nearest->gap_m >= capture_distance_m_) continue;
    link[0] = nearest->triangle;
    for (int i = 0; i < 3; ++i) link[1 + i] = nearest->weights(i);
  }
}

}  // namespace adhesim
