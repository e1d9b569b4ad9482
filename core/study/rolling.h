#pragma once

#include <vector>

#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// How a deformable ball rolls on ground whose normal is +z. Between two samples its mean rotation
// dtheta is that of the best fit of the way its particles went about its centre, weighted by mass.
// Rolling without slip takes the centre along the ground by
//     ds = dtheta x R z,     R: radius of the sphere of the ball's volume,
// and slip is what the centre's way differs from the sum of these.
class RollingMeter {
 public:
  // `ball` is closed. Samples must be less than a quarter of a turn apart.
  RollingMeter(const Model& model, const Body& ball, const State& start);

  void Sample(const State& state);

  double revolutions() const;  // of the arc that it rolled
  double rolled_m() const { return rolled_m_.norm(); }
  double travel_m() const { return travel_m_.norm(); }
  double slip_m() const { return (travel_m_ - rolled_m_).norm(); }

 private:
  const Model& model_;
  const Body& ball_;
  double radius_m_;
  std::vector<Vec3> last_m_;                                // [#particles of the ball]
  Vec3 rolled_m_ = Vec3::Zero(), travel_m_ = Vec3::Zero();  // along the ground
};

}  // namespace adhesim
