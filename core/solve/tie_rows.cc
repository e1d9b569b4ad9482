#include "core/solve/tie_rows.h"

#include <algorithm>

#include "core/model/carried.h"

namespace adhesim {
namespace {

// Less mobility than this share of what its particles would have if nothing held them: nothing that
// the tie could do.
constexpr double kNoMobility = 1e-9;
constexpr double kRoundOff = 1e-9;  // of the capture distance a sub-step
constexpr double kGiving = 1e-2;    // under a force f on m, it yields f / m * dt^2 / 100

Vec3 Three(std::span<const double> values, std::size_t tie) {
  return Vec3(values[3 * tie], values[3 * tie + 1], values[3 * tie + 2]);
}

void SetThree(const Vec3& value, std::size_t tie, std::span<double> values) {
  for (int k = 0; k < 3; ++k) values[3 * tie + k] = value(k);
}

}  // namespace

TieRows::TieRows(const Model& model) : model_(model), carried_(model) {
  if (!model.adhesive || !model.adhesive->ties) return;
  const std::size_t n = model.rest_position_m.size(), bonds = 4 * n + 64;
  ties_.reserve(bonds);
  loads_.reserve(bonds);
  start_.reserve(3 * bonds);
  acted_.reserve(n);
  acted_carried_.reserve(model.carried.size());
  stamp_.assign(n, 0);
  impulse_ns_.assign(n, Vec3::Zero());
}

void TieRows::Act(int p) {
  if (stamp_[p]) return;
  stamp_[p] = 1;
  acted_.push_back(p);
  const CarriedParticle* c = carried_.Find(p);
  if (!c) return;
  acted_carried_.push_back(c);
  for (const std::int32_t carrier : c->carriers) Act(carrier);
}

void TieRows::Collect(const State& state, std::span<const RigidGroup> groups,
                      std::span<const Vec3> per_kg, double dt_s) {
  for (int p : acted_) impulse_ns_[p].setZero();
  acted_.clear();
  acted_carried_.clear();
  ties_.clear();
  start_.clear();
  round_off_ = 0;
  if (!possible()) return;
  for (std::size_t b = 0; b < state.contacts.bonds.size(); ++b) {
    const Bond& bond = state.contacts.bonds[b];
    if (!bond.tied || ties_.size() == ties_.capacity()) continue;
    Tie tie;
    tie.bond = static_cast<std::int32_t>(b);
    tie.geometry = TieGeometryOf(bond, model_, state.position_m);
    tie.block = BlockOf(tie.geometry, state, groups, per_kg);
    tie.inverse = Mat3::Zero();
    if (tie.block.trace() > 0) tie.inverse = tie.block.inverse();
    tie.wanted_m_s.setZero();
    tie.impulse_ns.setZero();
    tie.gives = bond.calm < 0 ? kGiving : 0;
    const bool moves = tie.block.trace() > 0;
    if (dt_s > 0) {
      tie.wanted_m_s = (tie.geometry.frame * bond.tie_offset_m - tie.geometry.offset_m) / dt_s;
      const double speed = kRoundOff * model_.adhesive->capture_distance_m / dt_s;
      round_off_ += speed * speed * tie.inverse.trace();
    }
    ties_.push_back(tie);
    for (int k = 0; k < 3; ++k)
      start_.push_back(moves && dt_s > 0 ? dt_s * bond.tie_force_n(k) : 0);
    for (int p : tie.geometry.nodes.particle) Act(p);
  }
  for (int p : acted_) stamp_[p] = 0;
  std::sort(acted_.begin(), acted_.end());
  std::sort(acted_carried_.begin(), acted_carried_.end());  // as in the model
}

// The velocity that a unit impulse on the particle gives it.
Mat3 TieRows::Mobility(int p, const State& state, std::span<const RigidGroup> groups,
                       std::span<const Vec3> per_kg) const {
  if (model_.fixed[p]) return Mat3::Zero();
  if (const CarriedParticle* c = carried_.Find(p)) {
    Mat3 sum = Mat3::Zero();
    for (int k = 0; k < 4; ++k) {
      sum += c->weights[k] * c->weights[k] * Mobility(c->carriers[k], state, groups, per_kg);
    }
    return sum;
  }
  const int zone = state.contacts.zone_of[p];
  if (zone < 0) return per_kg[p].asDiagonal();
  Mat3 mobility;
  const Vec3 r = state.position_m[p] - groups[zone].pivot_m;
  for (int k = 0; k < 3; ++k) {
    const Twist response = groups[zone].Response(Vec3::Unit(k), r.cross(Vec3::Unit(k)));
    mobility.col(k) = response.linear_m_s + response.angular_rad_s.cross(r);
  }
  return mobility;
}

Mat3 TieRows::BlockOf(const TieGeometry& geometry, const State& state,
                      std::span<const RigidGroup> groups, std::span<const Vec3> per_kg) const {
  std::array<Mat3, TieGeometry::kNodes> mobility;
  int zone = -2;
  bool one = true;
  double free = 0;
  for (int i = 0; i < TieGeometry::kNodes; ++i) {
    const int p = geometry.nodes.particle[i];
    mobility[i] = Mobility(p, state, groups, per_kg);
    one =
        one && state.contacts.zone_of[p] >= 0 && (zone == -2 || state.contacts.zone_of[p] == zone);
    zone = state.contacts.zone_of[p];
    free += geometry.nodes.weight[i] * geometry.nodes.weight[i] * per_kg[p](0);
  }
  if (one) return Mat3::Zero();  // they move as one already
  Mat3 block;
  for (int k = 0; k < 3; ++k) {
    std::array<Vec3, TieGeometry::kNodes> velocity = geometry.Forces(Vec3::Unit(k));
    for (int i = 0; i < TieGeometry::kNodes; ++i) velocity[i] = mobility[i] * velocity[i];
    block.col(k) = geometry.Speed(velocity);
  }
  return block.trace() > kNoMobility * free ? block : Mat3::Zero();
}

void TieRows::Scatter(std::span<const double> multiplier, std::span<Vec3> impulse_ns) const {
  for (int p : acted_) impulse_ns[p].setZero();
  for (std::size_t t = 0; t < ties_.size(); ++t) {
    const TieGeometry& geometry = ties_[t].geometry;
    const auto impulses = geometry.Forces(Three(multiplier, t));
    for (int i = 0; i < TieGeometry::kNodes; ++i)
      impulse_ns[geometry.nodes.particle[i]] += impulses[i];
  }
  for (const CarriedParticle* c : acted_carried_) {
    for (int k = 0; k < 4; ++k)
      impulse_ns[c->carriers[k]] += c->weights[k] * impulse_ns[c->particle];
    impulse_ns[c->particle].setZero();
  }
}

void TieRows::Gather(std::span<Vec3> velocity_m_s, std::span<double> speed) const {
  for (const CarriedParticle* c : acted_carried_) {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < 4; ++k) sum += c->weights[k] * velocity_m_s[c->carriers[k]];
    velocity_m_s[c->particle] = sum;
  }
  for (std::size_t t = 0; t < ties_.size(); ++t) {
    std::array<Vec3, TieGeometry::kNodes> velocity;
    for (int i = 0; i < TieGeometry::kNodes; ++i)
      velocity[i] = velocity_m_s[ties_[t].geometry.nodes.particle[i]];
    // What nothing can move has no row.
    SetThree(ties_[t].inverse.isZero(0) ? Vec3::Zero() : ties_[t].geometry.Speed(velocity), t,
             speed);
  }
}

void TieRows::AddGiving(std::span<const double> multiplier, std::span<double> speed) const {
  for (std::size_t t = 0; t < ties_.size(); ++t) {
    if (ties_[t].gives == 0) continue;
    SetThree(Three(speed, t) + ties_[t].gives * (ties_[t].block * Three(multiplier, t)), t, speed);
  }
}

double TieRows::GivingLoss() const {
  double loss_j = 0;
  for (const Tie& tie : ties_) {
    if (tie.gives > 0) loss_j += tie.gives * tie.impulse_ns.dot(tie.block * tie.impulse_ns);
  }
  return loss_j;
}

void TieRows::Missing(std::span<const double> speed, std::span<double> missing) const {
  for (std::size_t t = 0; t < ties_.size(); ++t) {
    const bool moves = !ties_[t].inverse.isZero(0);
    SetThree(moves ? Vec3(ties_[t].wanted_m_s - Three(speed, t) -
                          ties_[t].gives * (ties_[t].block * ties_[t].impulse_ns))
                   : Vec3::Zero(),
             t, missing);
  }
}

double TieRows::Precondition(std::span<const double> r, std::span<double> z) const {
  double sum = 0;
  for (std::size_t t = 0; t < ties_.size(); ++t) {
    const Vec3 left = Three(r, t), solved = ties_[t].inverse * left;
    SetThree(solved, t, z);
    sum += left.dot(solved);
  }
  return sum;
}

double TieRows::BlockNorm(std::span<const double> multiplier) const {
  double sum = 0;
  for (std::size_t t = 0; t < ties_.size(); ++t) {
    const Vec3 impulse = Three(multiplier, t);
    sum += impulse.dot(ties_[t].block * impulse);
  }
  return sum;
}

void TieRows::Add(std::span<const double> multiplier, std::span<const Vec3> impulse_ns) {
  for (std::size_t t = 0; t < ties_.size(); ++t) ties_[t].impulse_ns += Three(multiplier, t);
  for (int p : acted_) impulse_ns_[p] += impulse_ns[p];
}

std::span<const TieLoad> TieRows::Loads(double dt_s) {
  loads_.clear();
  for (const Tie& tie : ties_) loads_.push_back({tie.bond, tie.impulse_ns / -dt_s});
  return loads_;
}

void TieRows::AddLoads(const State& state, double dt_s, std::span<Vec3> load_n) const {
  for (const Tie& tie : ties_) {
    const auto impulses = tie.geometry.Forces(tie.impulse_ns);
    for (int i = 0; i < TieGeometry::kNodes; ++i) {
      const int p = tie.geometry.nodes.particle[i];
      if (state.contacts.zone_of[p] < 0) load_n[p] -= impulses[i] / dt_s;
    }
  }
}

void TieRows::Store(double dt_s, Contacts* contacts) const {
  for (const Tie& tie : ties_) contacts->bonds[tie.bond].tie_force_n = tie.impulse_ns / dt_s;
}

}  // namespace adhesim
