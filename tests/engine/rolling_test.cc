#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

Vec3 CentreOfMass(const Model& model, const Body& body, const std::vector<Vec3>& x) {
  Vec3 sum = Vec3::Zero();
  double mass = 0;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    sum += model.mass_kg[p] * x[p];
    mass += model.mass_kg[p];
  }
  return sum / mass;
}

// The small rotation that takes a body from one shape to the next best in the mean over its
// particles, weighted by mass: I w = sum m r x d, with d the displacement relative to the centre.
Vec3 MeanRotation(const Model& model, const Body& body, const std::vector<Vec3>& from,
                  const std::vector<Vec3>& to) {
  const Vec3 centre = CentreOfMass(model, body, from);
  const Vec3 shift = CentreOfMass(model, body, to) - centre;
  Mat3 inertia = Mat3::Zero();
  Vec3 moment = Vec3::Zero();
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    const Vec3 r = from[p] - centre;
    inertia += model.mass_kg[p] * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
    moment += model.mass_kg[p] * r.cross(to[p] - from[p] - shift);
  }
  return inertia.ldlt().solve(moment);
}

// Fig. 4. Rolled arc: the ball's mean rotation, summed over the steps (a turn takes 1300), times
// the radius of a sphere of its volume, which it keeps. Slip: what the centre's way differs from
// that.
TEST(PaperScenes, BallRollsMoreThanATurnWithoutSlipping) {
  const auto engine = SceneEngine("paper/rolling_ball.yaml");
  const Model& model = engine->model();
  const Body& ball = model.bodies[1];
  const double radius_m = std::cbrt(ball.rest_volume_m3 * 3 / (4 * std::numbers::pi));
  const double start_m = CentreOfMass(model, ball, engine->state().position_m).x();
  double angle = 0;
  int last_in_the_air = 0;
  for (int step = 0; step < 2000; ++step) {
    const std::vector<Vec3> before = engine->state().position_m;
    EXPECT_EQ(engine->Step({}).bits, 0u);
    angle += MeanRotation(model, ball, before, engine->state().position_m).y();
    if (engine->state().contacts.colliding_particles == 0) last_in_the_air = step;
    if (step % 100 == 0) {
      const Penetration now = MeasurePenetration(model, engine->state().position_m);
      EXPECT_LE(now.max_depth_m, model.adhesive->capture_distance_m);
      EXPECT_EQ(now.vertices_inside, 0);
    }
  }
  EXPECT_LE(last_in_the_air, 200);  // the strip sags before the ball is on it
  const double travel_m = CentreOfMass(model, ball, engine->state().position_m).x() - start_m;
  EXPECT_GE(angle, 2 * std::numbers::pi);
  EXPECT_LE(std::abs(travel_m - radius_m * angle), 0.05 * travel_m);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

}  // namespace
}  // namespace adhesim::test
