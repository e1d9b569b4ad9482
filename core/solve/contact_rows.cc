#include "core/solve/contact_rows.h"

#include <algorithm>
#include <cmath>

#include "core/model/bond_geometry.h"
#include "core/model/carried.h"
#include "core/model/closest_point.h"
#include "core/model/tie_geometry.h"

namespace adhesim {
namespace {

// Sliding ends when a step moves the surfaces by less than this share of the capture distance.
constexpr double kStill = 1e-4;
// Less mobility than this share of what its particles would have if their zones were free: they
// move as one, or turn about a pin that is nearly in line. No sensible impulse changes anything
// there; a senseless one would spin the zone.
constexpr double kNoMobility = 1e-2;

}  // namespace

ContactRows::ContactRows(const Model& model) : model_(model), carried_(model) {
  const bool tools = std::any_of(model.tools.begin(), model.tools.end(), [](const ToolModel& tool) {
    return tool.friction_coefficient.has_value();
  });
  if (!model.adhesive || !(model.adhesive->friction_coefficient || tools)) return;
  const std::size_t n = model.rest_position_m.size();
  rows_.reserve(4 * n + 64);
  verdicts_.reserve(4 * n + 64);
  interfaces_.reserve(4 * n + 64);  // no more than rows
  acted_.reserve(n);
  impulse_ns_.assign(n, Vec3::Zero());
  stamp_.assign(n, 0);
  if (tools) touch_.assign(n, 0);
  if (model.integrator != Integrator::kExplicit) {
    laws_.reserve(rows_.capacity());
    if (tools) started_.reserve(rows_.capacity());
    for (auto* array : {&direction_, &product_, &step_, &way_m_s_, &left_ns_})
      array->assign(n + 2 * model.tools.size(), Padded{});
  }
  if (carried_.empty()) return;
  carried_touching_.reserve(model.carried.size());
  carried_impulse_ns_.assign(n, Vec3::Zero());
}

void ContactRows::Clear() {
  for (int p : acted_) impulse_ns_[p].setZero();
  acted_.clear();
  for (int p : carried_touching_) carried_impulse_ns_[p].setZero();
  carried_touching_.clear();
  rows_.clear();
}

void ContactRows::Collect(const State& state, const Motion& motion, const Tools& tools, double dt_s,
                          bool within) {
  Clear();
  within_ = within;
  if (!possible()) return;
  for (std::size_t b = 0; b < state.contacts.bonds.size(); ++b) {
    if (!state.contacts.bonds[b].sliding || rows_.size() == rows_.capacity()) continue;
    rows_.push_back(MakeRow(static_cast<int>(b), state, motion, tools, dt_s));
  }
  ShareLimits(state, tools, dt_s);
  for (const Row& row : rows_) {
    for (int p : row.particle) Act(p);
  }
  for (int p : acted_) stamp_[p] = 0;
  for (int p : carried_touching_) stamp_[p] = 0;
  std::sort(acted_.begin(), acted_.end());
  if (within) StartAsKept(state);
}

void ContactRows::Act(int p) {
  if (stamp_[p]) return;
  stamp_[p] = 1;
  const CarriedParticle* carried = carried_.Find(p);
  (carried ? carried_touching_ : acted_).push_back(p);
  if (!carried) return;
  for (const std::int32_t carrier : carried->carriers) Act(carrier);
}

ContactRows::Interface& ContactRows::InterfaceOf(const Bond& bond) {
  const auto [a, b] = std::minmax(model_.body_of[bond.particle],
                                  model_.body_of[model_.triangles[bond.triangle][0]]);
  const auto at = std::lower_bound(interfaces_.begin(), interfaces_.end(), std::pair(a, b),
                                   [](const Interface& interface, const auto& key) {
                                     return std::pair(interface.first, interface.second) < key;
                                   });
  if (at != interfaces_.end() && at->first == a && at->second == b) return *at;
  return *interfaces_.insert(at, {a, b, {}});
}

// Particles of both sides touch the same surface: together their rows carry what the weaker side
// carries, if both have any. Edges add none of their own.
void ContactRows::ShareLimits(const State& state, const Tools& tools, double dt_s) {
  interfaces_.clear();
  for (const Row& row : rows_) {
    const Bond& bond = state.contacts.bonds[row.bond];
    if (bond.tool >= 0 || bond.partner >= 0 || !row.touches) continue;
    Interface& interface = InterfaceOf(bond);
    const BondLimit limit = LimitOf(bond, bond.particle, model_);
    BondLimit& sum = interface.limit[model_.body_of[bond.particle] == interface.second];
    sum.normal_n += limit.normal_n;
    sum.shear_n += limit.shear_n;
  }
  for (Row& row : rows_) {
    const Bond& bond = state.contacts.bonds[row.bond];
    row.tension_ns = row.shear_ns = 0;
    if (bond.tool >= 0 || bond.partner >= 0 || !row.touches) continue;
    const auto& [a, b] = InterfaceOf(bond).limit;
    const auto share = [&](double one, double x, double y) {
      const double both = x > 0 && y > 0 ? std::min(x, y) : x + y;
      return both > 0 ? one * both / (x + y) * dt_s : 0;
    };
    const BondLimit limit = LimitOf(bond, bond.particle, model_);
    row.tension_ns = share(limit.normal_n, a.normal_n, b.normal_n);
    row.shear_ns = share(limit.shear_n, a.shear_n, b.shear_n);
  }
  if (!touch_.empty()) ShareToolLimits(state, tools, dt_s);
}

// What a particle's area carries is shared by the rows of a tool that touch it, by weight.
void ContactRows::ShareToolLimits(const State& state, const Tools& tools, double dt_s) {
  const auto visit = [&](std::size_t first, std::size_t end, const auto& change) {
    for (std::size_t r = first; r < end; ++r) {
      if (!rows_[r].touches) continue;
      for (int k = 0; k < 3; ++k) {
        const double weight = state.contacts.bonds[rows_[r].bond].weights[k];
        if (weight > 0) change(rows_[r], rows_[r].particle[k], weight);
      }
    }
  };
  // Bonds, and so rows, are in the order of tools.
  for (std::size_t first = 0, end; first < rows_.size(); first = end) {
    const int tool = rows_[first].tool;
    for (end = first; end < rows_.size() && rows_[end].tool == tool; ++end) {
    }
    if (tool < 0) continue;
    visit(first, end, [&](const Row&, int p, double) { touch_[p] = 0; });
    visit(first, end, [&](const Row&, int p, double weight) { touch_[p] += weight; });
    const double scale = dt_s * tools.strength_scale[tool];
    visit(first, end, [&](Row& row, int p, double weight) {
      const BondLimit limit = LimitOf(state.contacts.bonds[row.bond], p, model_);
      row.tension_ns += scale * weight / touch_[p] * limit.normal_n;
      row.shear_ns += scale * weight / touch_[p] * limit.shear_n;
    });
  }
}

Vec3 ContactRows::Velocity(int p, const State& state, const Motion& motion) const {
  if (const CarriedParticle* carried = carried_.Find(p)) {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < 4; ++k)
      sum += carried->weights[k] * Velocity(carried->carriers[k], state, motion);
    return sum;
  }
  if (model_.fixed[p]) return Vec3::Zero();
  const int zone = state.contacts.zone_of[p];
  return zone < 0 ? motion.velocity_m_s[p] : motion.groups[zone].VelocityAt(state.position_m[p]);
}

// Where the contact will be if velocities stay as they are: a particle that moves around an edge
// must not be stopped by the plane that stands across its way now.
BondGeometry ContactRows::Predict(const Bond& bond, const BondGeometry& now, const State& state,
                                  double dt_s, Vec3* weights) const {
  const auto moved = [&](int p) {
    return model_.fixed[p] ? state.position_m[p]
                           : Vec3(state.position_m[p] + dt_s * state.velocity_m_s[p]);
  };
  if (bond.partner >= 0) {  // edges: where they cross now
    *weights = Vec3(bond.weights[0], bond.weights[1], bond.weights[2]);
    const auto [particle, weight] = NodesOf(bond, model_.triangles[bond.triangle], *weights);
    BondGeometry then = now;
    for (int i = 0; i < kNodes; ++i) {
      then.gap_m += weight[i] * now.normal.dot(moved(particle[i]) - state.position_m[particle[i]]);
    }
    return then;
  }
  const Triangle& tri = model_.triangles[bond.triangle];
  const Vec3 x = moved(bond.particle), a = moved(tri[0]), b = moved(tri[1]), c = moved(tri[2]);
  *weights = ClosestPointOnTriangle(x, a, b, c).weights;
  const Vec3 offset = x - ((*weights)(0) * a + (*weights)(1) * b + (*weights)(2) * c);
  const double distance = offset.norm();
  const double sign = offset.dot(now.normal) < 0 ? -1 : 1;
  BondGeometry then{x, now.normal, sign * distance};
  if (distance > 1e-3 * model_.adhesive->capture_distance_m)
    then.normal = offset * (sign / distance);
  return then;
}

ContactRows::Row ContactRows::MakeRow(int b, const State& state, const Motion& motion,
                                      const Tools& tools, double dt_s) const {
  const Bond& bond = state.contacts.bonds[b];
  const AdhesiveParameters& adhesive = *model_.adhesive;
  const Triangle& tri = model_.triangles[bond.triangle];
  Row row;
  row.bond = b;
  row.tool = bond.tool;
  BondGeometry now;
  std::array<double, kNodes> weight{};
  Vec3 weights;
  if (bond.tool >= 0) {
    row.point_m.setZero();
    for (int k = 0; k < 3; ++k) row.point_m += bond.weights[k] * state.position_m[tri[k]];
    now = {row.point_m, state.tools[bond.tool].pose.orientation * bond.tool_normal, bond.gap_m};
    // The fourth takes no part.
    row.particle = {tri[0], tri[1], tri[2], tri[0]};
    weight = {bond.weights[0], bond.weights[1], bond.weights[2], 0};
    row.friction = *model_.tools[bond.tool].friction_coefficient;
  } else {
    now = GeometryOf(bond, model_, state.position_m);
    row.friction = *adhesive.friction_coefficient;
  }
  BondGeometry then = bond.tool >= 0 ? now : Predict(bond, now, state, dt_s, &weights);
  if (bond.tool < 0) {
    const BondNodes nodes = NodesOf(bond, tri, weights);
    row.particle = nodes.particle;
    weight = nodes.weight;
  }
  const Vec3& n = then.normal;
  const Vec3 t = n.unitOrthogonal();
  row.direction = {n, t, n.cross(t)};
  row.tool_before_m_s = row.tool_m_s = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < kNodes; ++i) row.gradient[k][i] = weight[i] * row.direction[k];
    if (bond.tool < 0) continue;
    const Vec3 arm = row.point_m - state.tools[bond.tool].pose.position_m;
    const auto along = [&](const Twist& twist) {
      return row.direction[k].dot(twist.linear_m_s + twist.angular_rad_s.cross(arm));
    };
    row.tool_before_m_s(k) = along(tools.before[bond.tool]);
    row.tool_m_s(k) = along(tools.coming[bond.tool]);
  }
  if (bond.tool < 0) LeaveNoMoment(state, &row);
  for (int k = 0; k < 3; ++k) row.mobility[k] = Mobility(row, k, state, motion.groups);
  // One value for both tangents: the impulse is clipped to a disc, not to a box.
  row.mobility[1] = row.mobility[2] = std::max(row.mobility[1], row.mobility[2]);
  const double rest_m = 0.5 * adhesive.capture_distance_m;
  row.touches = now.gap_m <= adhesive.capture_distance_m;
  // At the end of the sub-step the gap shall be no less than at rest, or than now and a little
  // more.
  double going = -row.tool_before_m_s(0);
  for (int i = 0; i < kNodes; ++i) {
    if (!model_.fixed[row.particle[i]])
      going += row.gradient[0][i].dot(state.velocity_m_s[row.particle[i]]);
  }
  if (bond.tool >= 0) then.gap_m = now.gap_m + dt_s * going;
  row.least_speed_m_s = std::min(0.0, going - (then.gap_m - std::min(rest_m, now.gap_m)) / dt_s);
  row.most_speed_m_s = 0;
  row.rub_speed_m_s.setZero();
  if (within_) return row;
  // Turned round: see above.
  row.least_speed_m_s = std::min(row.least_speed_m_s, -going);
  row.most_speed_m_s = std::max(0.0, -going);
  Eigen::Vector2d rubbed, rubbing;
  for (int k = 0; k < 2; ++k) {
    rubbed(k) = -row.tool_before_m_s(k + 1);
    for (int i = 0; i < kNodes; ++i) {
      if (!model_.fixed[row.particle[i]])
        rubbed(k) += row.gradient[k + 1][i].dot(state.velocity_m_s[row.particle[i]]);
    }
    rubbing(k) = Speed(row, k + 1, state, motion);
  }
  if (rubbed.dot(rubbing) < 0)
    row.rub_speed_m_s = -std::min(1.0, rubbing.norm() / rubbed.norm()) * rubbed;
  return row;
}

// The two sides are a gap apart, so that a tangential pair of impulses would leave a moment: the
// smallest change of all four takes it away.
void ContactRows::LeaveNoMoment(const State& state, Row* row) const {
  Vec3 centre = Vec3::Zero();
  for (int p : row->particle) centre += state.position_m[p] / kNodes;
  Mat3 spread = Mat3::Zero();
  for (int p : row->particle) {
    const Vec3 d = state.position_m[p] - centre;
    spread += d.squaredNorm() * Mat3::Identity() - d * d.transpose();
  }
  const Mat3 inverse_spread = spread.inverse();
  for (int k = 0; k < 3; ++k) {
    Vec3 moment = Vec3::Zero();
    for (int i = 0; i < kNodes; ++i) {
      moment += (state.position_m[row->particle[i]] - centre).cross(row->gradient[k][i]);
    }
    const Vec3 turn = inverse_spread * moment;
    for (int i = 0; i < kNodes; ++i) {
      row->gradient[k][i] -= turn.cross(Vec3(state.position_m[row->particle[i]] - centre));
    }
  }
}

std::span<const ContactRows::Node> ContactRows::NodesOfRow(
    const Row& row, int direction, std::array<Node, 4 * kNodes>* nodes) const {
  int count = 0;
  const auto add = [&](int p, const Vec3& gradient) {
    const auto end = nodes->begin() + count;
    const auto at =
        std::find_if(nodes->begin(), end, [p](const Node& n) { return n.particle == p; });
    if (at != end) {
      at->gradient += gradient;
    } else {
      (*nodes)[count++] = {p, gradient};
    }
  };
  for (int i = 0; i < kNodes; ++i) {
    const Vec3& gradient = row.gradient[direction][i];
    if (const CarriedParticle* carried = carried_.Find(row.particle[i])) {
      for (int k = 0; k < 4; ++k) add(carried->carriers[k], carried->weights[k] * gradient);
    } else {
      add(row.particle[i], gradient);
    }
  }
  return {nodes->data(), static_cast<std::size_t>(count)};
}

double ContactRows::Mobility(const Row& row, int direction, const State& state,
                             std::span<const RigidGroup> groups,
                             const SubspaceSystem* system) const {
  double sum = 0, separately = 0;
  std::array<Node, 4 * kNodes> storage;
  const std::span<const Node> nodes = NodesOfRow(row, direction, &storage);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto& [p, g] = nodes[i];
    const int zone = state.contacts.zone_of[p];
    if (model_.fixed[p]) continue;
    separately += g.squaredNorm() / (zone < 0 ? model_.mass_kg[p] : groups[zone].mass_kg);
    if (zone < 0) {
      sum += system ? g.dot(system->inverse_diagonal(p) * g) : g.squaredNorm() / model_.mass_kg[p];
      continue;
    }
    // Once a zone: all of its nodes together.
    bool first = true;
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    for (std::size_t j = 0; j < nodes.size(); ++j) {
      if (state.contacts.zone_of[nodes[j].particle] != zone) continue;
      first = first && j >= i;
      force += nodes[j].gradient;
      moment +=
          (state.position_m[nodes[j].particle] - groups[zone].pivot_m).cross(nodes[j].gradient);
    }
    if (!first) continue;
    const Twist response =
        system ? system->Response(zone, force, moment) : groups[zone].Response(force, moment);
    sum += force.dot(response.linear_m_s) + moment.dot(response.angular_rad_s);
  }
  return system || sum > kNoMobility * separately ? sum : 0;
}

double ContactRows::Speed(const Row& row, int direction, const State& state,
                          const Motion& motion) const {
  double speed = -row.tool_m_s(direction);
  for (int i = 0; i < kNodes; ++i) {
    speed += row.gradient[direction][i].dot(Velocity(row.particle[i], state, motion));
  }
  return speed;
}

void ContactRows::Apply(const Row& row, int direction, double impulse, const State& state,
                        const Motion* motion) {
  if (impulse == 0) return;
  const auto give = [&](int p, const Vec3& share) {
    impulse_ns_[p] += share;
    if (model_.fixed[p] || !motion) return;
    const int zone = state.contacts.zone_of[p];
    if (zone < 0) {
      motion->velocity_m_s[p] += share / model_.mass_kg[p];
    } else {
      RigidGroup& group = motion->groups[zone];
      group.AddImpulse(share, (state.position_m[p] - group.pivot_m).cross(share));
    }
  };
  for (int i = 0; i < kNodes; ++i) {
    const int p = row.particle[i];
    const Vec3 share = impulse * row.gradient[direction][i];
    if (const CarriedParticle* carried = carried_.Find(p)) {
      carried_impulse_ns_[p] += share;
      for (int k = 0; k < 4; ++k) give(carried->carriers[k], carried->weights[k] * share);
    } else {
      give(p, share);
    }
  }
}

void ContactRows::Sweep(const State& state, const Motion& motion) {
  for (Row& row : rows_) {
    if (row.mobility[0] > 0) {
      const double speed = Speed(row, 0, state, motion);
      const double push = row.impulse(0) + (row.least_speed_m_s - speed) / row.mobility[0];
      const double pull = row.impulse(0) + (row.most_speed_m_s - speed) / row.mobility[0];
      const double tension = row.touches ? row.tension_ns : 0;
      const double impulse = push > 0 ? push : std::max(std::min(pull, 0.0), -tension);
      Apply(row, 0, impulse - row.impulse(0), state, &motion);
      row.impulse(0) = impulse;
    }
    if (!(row.mobility[1] > 0)) continue;
    const double limit = FrictionLimit(row, row.impulse(0));
    Eigen::Vector2d rubbing;
    for (int k = 0; k < 2; ++k) {
      const double missing = row.rub_speed_m_s(k) - Speed(row, k + 1, state, motion);
      rubbing(k) = row.impulse(k + 1) + missing / row.mobility[k + 1];
    }
    const double size = rubbing.norm();
    if (size > limit) rubbing *= limit / size;
    for (int k = 0; k < 2; ++k) {
      Apply(row, k + 1, rubbing(k) - row.impulse(k + 1), state, &motion);
      row.impulse(k + 1) = rubbing(k);
    }
  }
}

std::span<const ContactRows::Verdict> ContactRows::Judge(const State& state, const Motion& motion,
                                                         double dt_s) {
  const double still = kStill * model_.adhesive->capture_distance_m / dt_s;
  verdicts_.clear();
  for (const Row& row : rows_) {
    const double friction = row.impulse.tail<2>().norm();
    const double limit = row.friction * std::max(row.impulse(0), 0.0) + row.shear_ns;
    const double sliding =
        Eigen::Vector2d(Speed(row, 1, state, motion), Speed(row, 2, state, motion)).norm();
    Outcome outcome = Outcome::kSlides;
    if (row.tension_ns > 0 && row.impulse(0) <= -row.tension_ns &&
        Speed(row, 0, state, motion) > still) {
      outcome = Outcome::kParts;
    } else if (row.impulse(0) == 0 && !row.touches) {
      outcome = Outcome::kApart;
    } else if (friction < limit && sliding < still) {
      outcome = Outcome::kSticks;
    }
    verdicts_.push_back({row.bond, outcome});
  }
  return verdicts_;
}

}  // namespace adhesim
