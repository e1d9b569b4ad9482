#include "core/solve/contact_rows.h"

#include <algorithm>
#include <cmath>

#include "core/model/bond_geometry.h"

namespace adhesim {
namespace {

// Sliding ends when a step moves the surfaces by less than this share of the capture distance.
constexpr double kStill = 1e-4;

}  // namespace

ContactRows::ContactRows(const Model& model) : model_(model) {
  if (!model.adhesive || !model.adhesive->friction_coefficient) return;
  const std::size_t n = model.rest_position_m.size();
  rows_.reserve(4 * n + 64);
  verdicts_.reserve(4 * n + 64);
  acted_.reserve(n);
  impulse_ns_.assign(n, Vec3::Zero());
  stamp_.assign(n, 0);
}

void ContactRows::Collect(const State& state, std::span<const RigidGroup> groups, double dt_s) {
  for (int p : acted_) impulse_ns_[p].setZero();
  acted_.clear();
  rows_.clear();
  if (impulse_ns_.empty()) return;
  for (std::size_t b = 0; b < state.contacts.bonds.size(); ++b) {
    if (!state.contacts.bonds[b].sliding || rows_.size() == rows_.capacity()) continue;
    rows_.push_back(MakeRow(static_cast<int>(b), state, groups, dt_s));
  }
  for (const Row& row : rows_) {
    for (int p : row.particle) {
      if (stamp_[p]) continue;
      stamp_[p] = 1;
      acted_.push_back(p);
    }
  }
  for (int p : acted_) stamp_[p] = 0;
  std::sort(acted_.begin(), acted_.end());
}

ContactRows::Row ContactRows::MakeRow(int b, const State& state, std::span<const RigidGroup> groups,
                                      double dt_s) const {
  const Bond& bond = state.contacts.bonds[b];
  const AdhesiveParameters& adhesive = *model_.adhesive;
  const BondGeometry geometry = GeometryOf(bond, model_, state.position_m);
  const Triangle& tri = model_.triangles[bond.triangle];
  Row row;
  row.bond = b;
  row.particle = {bond.particle, tri[0], tri[1], tri[2]};
  const std::array<double, kNodes> weight = {1, -bond.weights[0], -bond.weights[1],
                                             -bond.weights[2]};
  const Vec3& n = geometry.normal;
  const Vec3 t = n.unitOrthogonal();
  const std::array<Vec3, 3> direction = {n, t, n.cross(t)};

  // The two sides are a gap apart, so that a tangential pair of impulses would leave a moment: the
  // smallest change of all four takes it away.
  Vec3 centre = Vec3::Zero();
  for (int p : row.particle) centre += state.position_m[p] / kNodes;
  Mat3 spread = Mat3::Zero();
  for (int p : row.particle) {
    const Vec3 d = state.position_m[p] - centre;
    spread += d.squaredNorm() * Mat3::Identity() - d * d.transpose();
  }
  const Mat3 inverse_spread = spread.inverse();
  for (int k = 0; k < 3; ++k) {
    Vec3 moment = Vec3::Zero();
    for (int i = 0; i < kNodes; ++i) {
      row.gradient[k][i] = weight[i] * direction[k];
      moment += (state.position_m[row.particle[i]] - centre).cross(row.gradient[k][i]);
    }
    const Vec3 turn = inverse_spread * moment;
    for (int i = 0; i < kNodes; ++i) {
      row.gradient[k][i] -= turn.cross(Vec3(state.position_m[row.particle[i]] - centre));
    }
    row.mobility[k] = Mobility(row, k, state, groups);
  }
  // One value for both tangents: the impulse is clipped to a disc, not to a box.
  row.mobility[1] = row.mobility[2] = std::max(row.mobility[1], row.mobility[2]);
  const double room_m = geometry.gap_m - 0.5 * adhesive.capture_distance_m;
  row.approach_m_s = room_m > 0 ? -room_m / dt_s : 0;
  const BondLimit limit =
      LimitOf(adhesive, model_.area_m2[bond.particle], model_.mass_kg[bond.particle]);
  row.tension_ns = limit.normal_n * dt_s;
  row.shear_ns = limit.shear_n * dt_s;
  return row;
}

double ContactRows::Mobility(const Row& row, int direction, const State& state,
                             std::span<const RigidGroup> groups) const {
  double sum = 0;
  for (int i = 0; i < kNodes; ++i) {
    const int p = row.particle[i];
    const Vec3& g = row.gradient[direction][i];
    const int zone = state.contacts.zone_of[p];
    if (model_.fixed[p]) continue;
    if (zone < 0) {
      sum += g.squaredNorm() / model_.mass_kg[p];
      continue;
    }
    // Once a zone: all of its nodes together.
    bool first = true;
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    for (int j = 0; j < kNodes; ++j) {
      if (state.contacts.zone_of[row.particle[j]] != zone) continue;
      first = first && j >= i;
      force += row.gradient[direction][j];
      moment += (state.position_m[row.particle[j]] - groups[zone].pivot_m)
                    .cross(row.gradient[direction][j]);
    }
    if (!first) continue;
    const Twist response = groups[zone].Response(force, moment);
    sum += force.dot(response.linear_m_s) + moment.dot(response.angular_rad_s);
  }
  return sum;
}

double ContactRows::Speed(const Row& row, int direction, const State& state,
                          const Motion& motion) const {
  double speed = 0;
  for (int i = 0; i < kNodes; ++i) {
    const int p = row.particle[i];
    if (model_.fixed[p]) continue;
    const int zone = state.contacts.zone_of[p];
    speed += row.gradient[direction][i].dot(
        zone < 0 ? motion.velocity_m_s[p] : motion.groups[zone].VelocityAt(state.position_m[p]));
  }
  return speed;
}

void ContactRows::Apply(const Row& row, int direction, double impulse, const State& state,
                        const Motion& motion) {
  if (impulse == 0) return;
  for (int i = 0; i < kNodes; ++i) {
    const int p = row.particle[i];
    const Vec3 share = impulse * row.gradient[direction][i];
    impulse_ns_[p] += share;
    if (model_.fixed[p]) continue;
    const int zone = state.contacts.zone_of[p];
    if (zone < 0) {
      motion.velocity_m_s[p] += share / model_.mass_kg[p];
    } else {
      RigidGroup& group = motion.groups[zone];
      group.AddImpulse(share, (state.position_m[p] - group.pivot_m).cross(share));
    }
  }
}

void ContactRows::Sweep(const State& state, const Motion& motion) {
  const double mu = *model_.adhesive->friction_coefficient;
  for (Row& row : rows_) {
    if (row.mobility[0] > 0) {
      const double speed = Speed(row, 0, state, motion);
      const double push = row.impulse(0) + (row.approach_m_s - speed) / row.mobility[0];
      const double pull = row.impulse(0) - speed / row.mobility[0];
      const double impulse = push > 0 ? push : std::max(std::min(pull, 0.0), -row.tension_ns);
      Apply(row, 0, impulse - row.impulse(0), state, motion);
      row.impulse(0) = impulse;
    }
    if (!(row.mobility[1] > 0)) continue;
    // The adhesive acts across what touches only.
    const bool touches = row.impulse(0) != 0 || row.approach_m_s == 0;
    const double limit = touches ? mu * std::max(row.impulse(0), 0.0) + row.shear_ns : 0;
    Eigen::Vector2d rubbing{row.impulse(1) - Speed(row, 1, state, motion) / row.mobility[1],
                            row.impulse(2) - Speed(row, 2, state, motion) / row.mobility[1]};
    const double size = rubbing.norm();
    if (size > limit) rubbing *= limit / size;
    for (int k = 0; k < 2; ++k) {
      Apply(row, k + 1, rubbing(k) - row.impulse(k + 1), state, motion);
      row.impulse(k + 1) = rubbing(k);
    }
  }
}

std::span<const ContactRows::Verdict> ContactRows::Judge(const State& state, const Motion& motion,
                                                         double dt_s) {
  const double mu = *model_.adhesive->friction_coefficient;
  const double still = kStill * model_.adhesive->capture_distance_m / dt_s;
  verdicts_.clear();
  for (const Row& row : rows_) {
    const double friction = row.impulse.tail<2>().norm();
    const double limit = mu * std::max(row.impulse(0), 0.0) + row.shear_ns;
    const double sliding =
        Eigen::Vector2d(Speed(row, 1, state, motion), Speed(row, 2, state, motion)).norm();
    Outcome outcome = Outcome::kSlides;
    if (row.tension_ns > 0 && row.impulse(0) <= -row.tension_ns) {
      outcome = Outcome::kParts;
    } else if (row.impulse(0) == 0 && row.approach_m_s < 0) {
      outcome = Outcome::kApart;
    } else if (friction < limit && sliding < still) {
      outcome = Outcome::kSticks;
    }
    verdicts_.push_back({row.bond, outcome});
  }
  return verdicts_;
}

}  // namespace adhesim
