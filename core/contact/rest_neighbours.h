#pragma once

#include <cstdint>
#include <vector>

#include "core/model/model.h"

namespace adhesim {

// Which parts of one body are too near each other by their make to collide: within two mesh edges,
// or nearer at rest than `apart_m` (both sides of a thin wall, the rim of a slit).
class RestNeighbours {
 public:
  RestNeighbours(const Model& model, double apart_m);

  // The particle to ask about; And() adds another. Allocates nothing.
  void Of(int particle);
  void And(int particle);
  // Whether `particle` is within two mesh edges of one of these.
  bool Include(int particle) const { return round_of_[particle] == round_; }
  bool IncludeTriangle(int triangle) const;
  // Whether things this far apart at rest are too near.
  bool TooNearAtRest(double distance_sq_m2) const { return distance_sq_m2 < apart_m_ * apart_m_; }

 private:
  const Model& model_;
  double apart_m_;
  std::uint32_t round_ = 0;
  std::vector<std::uint32_t> round_of_;  // [#particles] the round that reached it last
};

}  // namespace adhesim
