#include "core/contact/rest_neighbours.h"

#include <algorithm>

namespace adhesim {

RestNeighbours::RestNeighbours(const Model& model, double apart_m)
    : model_(model), apart_m_(apart_m), round_of_(model.rest_position_m.size(), 0) {}

void RestNeighbours::Of(int particle) {
  if (++round_ == 0) {  // once in four billion
    std::fill(round_of_.begin(), round_of_.end(), 0);
    round_ = 1;
  }
  And(particle);
}

void RestNeighbours::And(int particle) {
  round_of_[particle] = round_;
  for (int k = model_.neighbour_start[particle]; k < model_.neighbour_start[particle + 1]; ++k) {
    const int ring = model_.neighbours[k];
    round_of_[ring] = round_;
    for (int l = model_.neighbour_start[ring]; l < model_.neighbour_start[ring + 1]; ++l) {
      round_of_[model_.neighbours[l]] = round_;
    }
  }
}

bool RestNeighbours::IncludeTriangle(int triangle) const {
  return std::ranges::any_of(model_.triangles[triangle], [this](int v) { return Include(v); });
}

}  // namespace adhesim
