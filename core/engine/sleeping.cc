#include "core/engine/sleeping.h"

#include <algorithm>
#include <cmath>

#include "core/model/awake.h"

namespace adhesim {
namespace {

// Fixed particles that are this near to a line, relative to its length, leave a turn about it.
constexpr double kOnLine = 1e-6;

std::span<const std::int32_t> Members(const Contacts& contacts, const Zone& zone) {
  return std::span(contacts.zone_members).subspan(zone.first, zone.count);
}

}  // namespace

Sleeping::Sleeping(const Model& model, double reach_m, bool together)
    : model_(model),
      reach_m_(reach_m),
      together_(together),
      islands_(model.bodies.size()),
      kept_awake_(islands_.size()) {
  // One look more than steps: the first one has no time before it.
  const double looks = std::ceil(model.sleep->time_s / model.dt_s - 1e-9) + 1;
  tired_after_ = static_cast<std::int32_t>(std::clamp(looks, 2.0, 1e9));
  tired_.reserve(islands_.size());
  held_.resize(islands_.size());
  pulled_.resize(islands_.size());
  const auto slides = [](const ToolModel& tool) { return tool.friction_coefficient.has_value(); };
  rubs_ = (model.adhesive && model.adhesive->friction_coefficient) ||
          std::any_of(model.tools.begin(), model.tools.end(), slides);
}

void Sleeping::Start(const Model& model, State* state) {
  const std::size_t bodies = model.bodies.size();
  Sleep& sleep = state->sleep;
  sleep.asleep.assign(bodies, 0);
  sleep.calm_steps.assign(bodies, 0);
  sleep.awake.assign(1, {0, model.particle_count()});
  sleep.box_m.assign(bodies, Aabb{});
  sleep.load_n.assign(model.rest_position_m.size(), Vec3::Zero());
  sleep.strain_energy_j.assign(model.rest_position_m.size(), 0);
}

void Sleeping::Reserve(const Model& model, State* state) {
  state->sleep.awake.reserve(model.bodies.size() + 1);
}

void Sleeping::MeasureBoxes(State* state) const {
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    if (state->sleep.asleep[b]) continue;
    const Body& body = model_.bodies[b];
    Aabb& box = state->sleep.box_m[b];
    box = {};
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      box.Add(state->position_m[p]);
    }
  }
}

bool Sleeping::Wake(std::span<const BodyPair> pairs, std::span<const Aabb> tools, State* state) {
  Sleep& sleep = state->sleep;
  if (sleep.bodies == 0) return false;
  MeasureBoxes(state);
  const int before = sleep.bodies;
  const auto wake = [&](int body) {
    if (!sleep.asleep[body]) return;
    sleep.asleep[body] = 0;
    sleep.calm_steps[body] = 0;
    --sleep.bodies;
  };
  for (const Aabb& tool : tools) {
    const Aabb near = tool.Grown(reach_m_);
    for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
      if (sleep.asleep[b] && near.Overlaps(sleep.box_m[b])) wake(static_cast<int>(b));
    }
  }
  if (together_) {
    if (sleep.bodies < before) WakeAll(state);
    return sleep.bodies < before;
  }
  for (int left = before + 1; left != sleep.bodies;) {
    left = sleep.bodies;
    for (const BodyPair& pair : pairs) {
      if (sleep.asleep[pair.body] == sleep.asleep[pair.other] || pair.body > pair.other) continue;
      if (!CanMove(pair.body) || !CanMove(pair.other) || !Near(sleep, pair.body, pair.other)) {
        continue;
      }
      wake(pair.body);
      wake(pair.other);
    }
    for (const Zone& zone : state->contacts.zones) {
      if (!zone.holds_sleepers || zone.asleep) continue;
      if (PinsLock(state->contacts, zone, state->position_m)) continue;
      for (int p : Members(state->contacts, zone)) wake(model_.body_of[p]);
    }
  }
  if (sleep.bodies == before) return false;
  Update(state);
  return true;
}

void Sleeping::WakeAll(State* state) {
  std::fill(state->sleep.asleep.begin(), state->sleep.asleep.end(), 0);
  std::fill(state->sleep.calm_steps.begin(), state->sleep.calm_steps.end(), 0);
  state->sleep.bodies = 0;
  Update(state);
}

// Three fixed particles that are not on a line leave a zone no motion.
bool Sleeping::PinsLock(const Contacts& contacts, const Zone& zone,
                        std::span<const Vec3> position_m) const {
  if (zone.pins < 3) return false;
  const Vec3* first = nullptr;
  Vec3 along = Vec3::Zero();
  for (int p : Members(contacts, zone)) {
    if (!model_.fixed[p]) continue;
    if (!first) first = &position_m[p];
    const Vec3 to = position_m[p] - *first;
    if (along.isZero(0)) {
      along = to;
    } else if (along.cross(to).norm() > kOnLine * along.squaredNorm()) {
      return true;
    }
  }
  return false;
}

// By the power P of elastic forces and fields, which is none at rest: that of what creeps goes into
// damping and drag, and would make it faster than permitted, P t > m v^2 / 2, if it did not. (Not
// by the forces themselves: a solve may leave a hundredth of the elastic ones, for ever.)
bool Sleeping::IsCalm(const Body& body, const Forces& forces, const State& state) const {
  const double speed_sq = model_.sleep->speed_m_s * model_.sleep->speed_m_s;
  double power_w = 0, mass_kg = 0;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    const Vec3& velocity = state.velocity_m_s[p];
    if (!(velocity.squaredNorm() <= speed_sq)) return false;
    if (!forces.elastic_n.empty()) power_w += forces.elastic_n[p].dot(velocity);
    if (!forces.field_n.empty()) power_w += forces.field_n[p].dot(velocity);
    mass_kg += model_.mass_kg[p];
  }
  return power_w * model_.sleep->time_s <= 0.5 * mass_kg * speed_sq;
}

std::span<const std::int32_t> Sleeping::Tire(std::span<const BodyPair> pairs,
                                             std::span<const Aabb> tools, const Forces& forces,
                                             State* state) {
  Sleep& sleep = state->sleep;
  tired_.clear();
  bool any = false;
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    if (sleep.asleep[b] || !CanMove(static_cast<int>(b))) continue;
    const bool calm = IsCalm(model_.bodies[b], forces, *state);
    sleep.calm_steps[b] = calm ? std::min(sleep.calm_steps[b] + 1, tired_after_) : 0;
    any = any || sleep.calm_steps[b] == tired_after_;
  }
  if (!any || state->contacts.overlapping) return tired_;
  MeasureBoxes(state);
  KeepAwake(state->contacts, tools, sleep);
  Join(pairs, *state);
  KeepFallersAwake(forces.field_n, state->contacts);
  bool all = true;
  for (int b = 0; b < static_cast<int>(islands_.size()); ++b) {
    if (sleep.asleep[b] || !CanMove(b)) continue;
    if (!kept_awake_[islands_.Root(b)]) {
      tired_.push_back(b);
    } else {
      all = false;
    }
  }
  if (together_ && !all) tired_.clear();
  return tired_;
}

// What keeps a body awake besides its own motion.
void Sleeping::KeepAwake(const Contacts& contacts, std::span<const Aabb> tools,
                         const Sleep& sleep) {
  for (std::size_t b = 0; b < islands_.size(); ++b) {
    kept_awake_[b] = sleep.calm_steps[b] < tired_after_;
    for (const Aabb& tool : tools) {
      kept_awake_[b] |= tool.Grown(reach_m_).Overlaps(sleep.box_m[b]);
    }
  }
  for (const Bond& bond : contacts.bonds) {
    if (bond.tool < 0 && !bond.sliding) continue;
    if (bond.particle >= 0) kept_awake_[model_.body_of[bond.particle]] = 1;
    kept_awake_[model_.body_of[model_.triangles[bond.triangle][0]]] = 1;
  }
}

// Islands of what is awake.
void Sleeping::Join(std::span<const BodyPair> pairs, const State& state) {
  islands_.Reset();
  const auto joins = [&](int body) { return !state.sleep.asleep[body] && CanMove(body); };
  for (const BodyPair& pair : pairs) {
    if (pair.body >= pair.other || !joins(pair.body) || !joins(pair.other)) continue;
    if (Near(state.sleep, pair.body, pair.other)) Unite(pair.body, pair.other);
  }
  for (const Zone& zone : state.contacts.zones) {
    if (zone.asleep || PinsLock(state.contacts, zone, state.position_m)) continue;
    int first = -1;
    for (int p : Members(state.contacts, zone)) {
      const int body = model_.body_of[p];
      if (!joins(body)) continue;
      if (first >= 0) Unite(first, body);
      first = body;
    }
  }
}

// At the top of its flight everything is slow: an island that a field pulls at has to be held by
// something that is fixed.
void Sleeping::KeepFallersAwake(std::span<const Vec3> field_n, const Contacts& contacts) {
  if (field_n.empty()) return;
  std::fill(held_.begin(), held_.end(), 0);
  std::fill(pulled_.begin(), pulled_.end(), 0);
  for (std::size_t b = 0; b < islands_.size(); ++b) {
    const Body& body = model_.bodies[b];
    const int root = islands_.Root(static_cast<int>(b));
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      held_[root] |= model_.fixed[p];
      pulled_[root] |= !field_n[p].isZero(0);
    }
  }
  for (const Zone& zone : contacts.zones) {
    if (zone.pins == 0) continue;
    for (int p : Members(contacts, zone)) held_[islands_.Root(model_.body_of[p])] = 1;
  }
  for (std::size_t b = 0; b < islands_.size(); ++b) kept_awake_[b] |= pulled_[b] && !held_[b];
}

void Sleeping::Unite(int a, int b) {
  const auto [root, former] = islands_.Unite(a, b);
  kept_awake_[root] |= kept_awake_[former];
}

void Sleeping::PutToSleep(std::span<const std::int32_t> bodies, std::span<const Vec3> load_n,
                          std::span<const double> strain_energy_j, State* state) {
  Sleep& sleep = state->sleep;
  for (int b : bodies) {
    sleep.asleep[b] = 1;
    ++sleep.bodies;
    const Body& body = model_.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      sleep.load_n[p] = load_n[p];
      sleep.strain_energy_j[p] = strain_energy_j.empty() ? 0 : strain_energy_j[p];
    }
  }
  Update(state);
}

// What follows from who sleeps.
void Sleeping::Update(State* state) const {
  Sleep& sleep = state->sleep;
  sleep.awake.clear();
  sleep.elastic_j = 0;
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    const Body& body = model_.bodies[b];
    const int end = body.first_particle + body.particle_count;
    if (sleep.asleep[b]) {
      for (int p = body.first_particle; p < end; ++p) sleep.elastic_j += sleep.strain_energy_j[p];
    } else if (!CanMove(static_cast<int>(b)) && !rubs_) {
      continue;  // nothing acts on it
    } else if (!sleep.awake.empty() && sleep.awake.back().end == body.first_particle) {
      sleep.awake.back().end = end;
    } else {
      sleep.awake.push_back({body.first_particle, end});
    }
  }
  MarkZones(state);
}

void Sleeping::MarkZones(State* state) const {
  for (Zone& zone : state->contacts.zones) {
    bool sleepers = false, others = false;
    for (int p : Members(state->contacts, zone)) {
      const int body = model_.body_of[p];
      sleepers = sleepers || state->sleep.Of(body);
      others = others || (!state->sleep.Of(body) && CanMove(body));
    }
    zone.holds_sleepers = sleepers;
    zone.asleep = sleepers && !others;
    if (!zone.asleep) continue;
    zone.momentum_kg_m_s.setZero();
    zone.angular_momentum_kg_m2_s.setZero();
  }
}

}  // namespace adhesim
