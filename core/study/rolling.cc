#include "core/study/rolling.h"

#include <cmath>
#include <numbers>

#include "core/model/polar.h"

namespace adhesim {
namespace {

Vec3 AlongGround(const Vec3& v) { return {v.x(), v.y(), 0}; }

}  // namespace

RollingMeter::RollingMeter(const Model& model, const Body& ball, const State& start)
    : model_(model),
      ball_(ball),
      radius_m_(std::cbrt(std::abs(ball.rest_volume_m3) * 3 / (4 * std::numbers::pi))) {
  const auto first = start.position_m.begin() + ball.first_particle;
  last_m_.assign(first, first + ball.particle_count);
}

void RollingMeter::Sample(const State& state) {
  Vec3 before = Vec3::Zero(), after = Vec3::Zero();
  double mass = 0;
  for (int i = 0; i < ball_.particle_count; ++i) {
    const double m = model_.mass_kg[ball_.first_particle + i];
    before += m * last_m_[i];
    after += m * state.position_m[ball_.first_particle + i];
    mass += m;
  }
  before /= mass;
  after /= mass;
  // A = sum m r' r^T; its polar rotation is the mean rotation.
  Mat3 a = Mat3::Zero();
  for (int i = 0; i < ball_.particle_count; ++i) {
    const int p = ball_.first_particle + i;
    const Vec3 from = last_m_[i] - before, to = state.position_m[p] - after;
    a += model_.mass_kg[p] * to * from.transpose();
    last_m_[i] = state.position_m[p];
  }
  const Eigen::AngleAxisd turn(PolarRotation(a, Quat::Identity()));
  const Vec3 rotation = turn.angle() * turn.axis();
  rolled_m_ += AlongGround(rotation.cross(radius_m_ * Vec3::UnitZ()));
  travel_m_ += AlongGround(after - before);
}

double RollingMeter::revolutions() const { return rolled_m() / (2 * std::numbers::pi * radius_m_); }

}  // namespace adhesim
