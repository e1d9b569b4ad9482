#include "core/solve/arcs.h"

#include <algorithm>
#include <cmath>

#include "core/solve/rigid_group.h"

namespace adhesim {
namespace {

// rad in a step: below it, what is left out is less than rounded positions are.
constexpr double kLeastAngle = 1e-7;

}  // namespace

Arcs::Arcs(const Model& model) : model_(model) {
  for (const Body& body : model.bodies) {
    const bool tissue = body.tetrahedron_count > 0 && !body.rigid;
    of_.push_back({tissue, false, Vec3::Zero(), Vec3::Zero(), Mat3::Zero()});
  }
}

// Of a body; `about`: a particle that it turns about, if something is held.
Hold Arcs::HoldOf(const Body& body, const State& state, int* about) const {
  Hold hold;
  bool driven = false, pinned = false;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    const int zone = state.contacts.zone_of[p];
    const bool by_tool = zone >= 0 && state.contacts.zones[zone].tool >= 0;
    const bool by_pin = model_.fixed[p] || (zone >= 0 && state.contacts.zones[zone].pins > 0);
    if (!by_tool && !by_pin) continue;
    if (hold.free()) *about = p;
    if (by_pin || hold.free()) hold.Add(state.position_m[p]);
    driven = driven || by_tool;
    pinned = pinned || by_pin;
    if (driven && pinned) hold.Lock();
    if (hold.locked()) break;
  }
  return hold;
}

Vec3 Arcs::TurnOf(std::size_t b, const State& state, std::span<const Vec3> velocity_m_s,
                  std::span<const Vec3> force_n, double dt_s, Vec3* centre_m) const {
  if (!of_[b].tissue || state.sleep.Of(static_cast<int>(b))) return Vec3::Zero();
  const int first = model_.bodies[b].first_particle;
  const int end = first + model_.bodies[b].particle_count;
  // About what is held, or the first particle: far from the origin nothing is lost.
  int about = first;
  const Hold hold = HoldOf(model_.bodies[b], state, &about);
  if (hold.locked()) return Vec3::Zero();
  const Vec3 &origin = state.position_m[about], &along = velocity_m_s[about];
  double mass = 0;
  Vec3 centre = Vec3::Zero(), momentum = Vec3::Zero(), moment = Vec3::Zero();
  Mat3 spread = Mat3::Zero();
  for (int p = first; p < end; ++p) {
    const double m = model_.mass_kg[p];
    const Vec3 r = state.position_m[p] - origin;
    Vec3 linear = m * (velocity_m_s[p] - along);
    if (!force_n.empty()) linear += dt_s * force_n[p];
    mass += m;
    centre += m * r;
    momentum += linear;
    moment += r.cross(linear);
    spread += m * r * r.transpose();
  }
  if (hold.free()) {
    centre /= mass;
    moment -= centre.cross(momentum);
    spread -= mass * centre * centre.transpose();
  } else {
    centre.setZero();
  }
  *centre_m = origin + centre;
  return hold.InverseInertia(spread) * moment;
}

double Arcs::FastestTurn(const State& state, std::span<const Vec3> velocity_m_s) const {
  double fastest_sq = 0;
  Vec3 centre_m;
  for (std::size_t b = 0; b < of_.size(); ++b) {
    fastest_sq =
        std::max(fastest_sq, TurnOf(b, state, velocity_m_s, {}, 0, &centre_m).squaredNorm());
  }
  return std::sqrt(fastest_sq);
}

void Arcs::Update(const State& state, std::span<const Vec3> force_n, double dt_s) {
  widest_rad_ = 0;
  for (std::size_t b = 0; b < of_.size(); ++b) {
    Arc& arc = of_[b];
    const Vec3 w = TurnOf(b, state, state.velocity_m_s, force_n, dt_s, &arc.centre_m);
    arc.turns = dt_s * w.norm() > kLeastAngle;
    if (!arc.turns) continue;
    widest_rad_ = std::max(widest_rad_, dt_s * w.norm());
    arc.turn_rad_s = w;
    arc.bend = (RotationStep(w, dt_s).toRotationMatrix() - Mat3::Identity()) / dt_s;
    arc.bend -= CrossMatrix(w);
  }
}

}  // namespace adhesim
