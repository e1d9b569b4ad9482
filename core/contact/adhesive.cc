#include "core/contact/adhesive.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace adhesim {
namespace {

// Slower than this fraction of d_on per step is round-off, not approach.
constexpr double kApproach = 1e-9;

std::tuple<int, int, int> Key(const Bond& bond) {
  return {bond.particle, bond.tool, bond.triangle};
}

bool Insert(const Bond& bond, Contacts* contacts, StepReport* report) {
  if (contacts->bonds.size() == contacts->bonds.capacity()) {
    report->bits |= kStepBondCapacity;
    return false;
  }
  const auto at = std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond,
                                   [](const Bond& a, const Bond& b) { return Key(a) < Key(b); });
  contacts->bonds.insert(at, bond);
  return true;
}

bool PairLess(const ReleasedPair& a, const ReleasedPair& b) {
  return a.particle != b.particle ? a.particle < b.particle : a.other < b.other;
}

int ToolKey(int tool) { return -1 - tool; }

}  // namespace

Adhesive::Adhesive(const Model& model) : model_(model) {
  if (model.adhesive) {
    capture_distance_m_ = model.adhesive->capture_distance_m;
    release_distance_m_ = model.adhesive->release_distance_m;
  }
  limit_.resize(model.rest_position_m.size());
  load_n_.resize(model.rest_position_m.size());
  touched_.resize(model.rest_position_m.size() * model.tools.size());
  kept_.reserve(4 * model.rest_position_m.size() + 64);
}

const ReleasedPair* Adhesive::FindReleased(const Contacts& contacts, int particle,
                                           int other) const {
  const ReleasedPair key{particle, other, 0};
  const auto at =
      std::lower_bound(contacts.released.begin(), contacts.released.end(), key, PairLess);
  return at != contacts.released.end() && at->particle == particle && at->other == other ? &*at
                                                                                         : nullptr;
}

void Adhesive::AddReleased(int particle, int other, double gap_m, Contacts* contacts) {
  const ReleasedPair pair{particle, other, gap_m};
  const auto at =
      std::lower_bound(contacts->released.begin(), contacts->released.end(), pair, PairLess);
  if (at != contacts->released.end() && at->particle == particle && at->other == other) {
    at->gap_m = gap_m;
  } else if (contacts->released.size() < contacts->released.capacity()) {
    contacts->released.insert(at, pair);
  }
}

int Adhesive::Capture(std::span<const NearPair> near, const State& state, double dt_s,
                      Contacts* contacts, StepReport* report) {
  // Both lists ascend by (particle, body): keep the released pairs that are still within d_off.
  kept_.clear();
  auto pair = near.begin();
  for (const ReleasedPair& released : contacts->released) {
    if (released.other < 0) {
      kept_.push_back(released);
      continue;
    }
    while (pair != near.end() &&
           std::pair(pair->particle, pair->body) < std::pair(released.particle, released.other)) {
      ++pair;
    }
    const bool near_enough = pair != near.end() && pair->particle == released.particle &&
                             pair->body == released.other && pair->gap_m <= release_distance_m_;
    if (near_enough) kept_.push_back(released);
  }
  contacts->released.assign(kept_.begin(), kept_.end());

  const double still = kApproach * capture_distance_m_ / dt_s;
  int captured = 0;
  for (const NearPair& candidate : near) {
    if (candidate.gap_m >= capture_distance_m_) continue;
    const Triangle& tri = model_.triangles[candidate.triangle];
    Vec3 surface = Vec3::Zero();
    for (int k = 0; k < 3; ++k) surface += candidate.weights(k) * state.velocity_m_s[tri[k]];
    const double speed = candidate.normal.dot(state.velocity_m_s[candidate.particle] - surface);
    if (candidate.gap_m >= 0 && speed >= -still) continue;
    const ReleasedPair* released = FindReleased(*contacts, candidate.particle, candidate.body);
    if (released && candidate.gap_m >= released->gap_m) continue;
    // One bond a particle and body.
    const auto first =
        std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), candidate.particle,
                         [](const Bond& bond, int p) { return bond.particle < p; });
    bool bonded = false;
    for (auto it = first; it != contacts->bonds.end() && it->particle == candidate.particle; ++it) {
      bonded = bonded || model_.body_of[model_.triangles[it->triangle][0]] == candidate.body;
    }
    if (bonded) continue;
    Bond bond;
    bond.particle = candidate.particle;
    bond.triangle = candidate.triangle;
    bond.side = candidate.side;
    bond.gap_sign = candidate.gap_m < 0 ? -1 : 1;
    for (int k = 0; k < 3; ++k) {
      bond.weights[k] = candidate.weights(k);
      bond.vertices[k] = candidate.weights(k) > kMinWeight ? tri[k] : -1;
    }
    captured += Insert(bond, contacts, report);
  }
  report->captures += captured;
  return captured;
}

int Adhesive::CaptureByTools(std::span<const NearTool> near, const State& state, Contacts* contacts,
                             StepReport* report) {
  const int tools = static_cast<int>(model_.tools.size());
  std::fill(touched_.begin(), touched_.end(), 0);
  for (const NearTool& pair : near) {
    for (int p : model_.triangles[pair.triangle]) touched_[p * tools + pair.tool] = 1;
  }
  std::erase_if(contacts->released, [&](const ReleasedPair& released) {
    return released.other < 0 && !touched_[released.particle * tools + (-1 - released.other)];
  });
  int captured = 0;
  for (const NearTool& pair : near) {
    if (pair.gap_m >= capture_distance_m_ || !(pair.approaching || pair.gap_m < 0)) continue;
    Bond bond;
    bond.tool = pair.tool;
    bond.triangle = pair.triangle;
    bond.sticky = pair.sticky;
    bond.tool_normal = state.tools[pair.tool].pose.orientation.conjugate() * pair.normal;
    bool adds = false;
    for (int k = 0; k < 3; ++k) {
      bond.weights[k] = pair.weights(k);
      const int v = model_.triangles[pair.triangle][k];
      const ReleasedPair* released = FindReleased(*contacts, v, ToolKey(pair.tool));
      const bool eligible = pair.weights(k) > kMinWeight && !model_.fixed[v] &&
                            !(released && pair.gap_m >= released->gap_m);
      bond.vertices[k] = eligible ? v : -1;
      // A particle that the tool already holds needs no second bond.
      const int zone = contacts->zone_of[v];
      adds = adds || (eligible && (zone < 0 || contacts->zones[zone].tool != pair.tool));
    }
    if (!adds) continue;
    const auto at = std::lower_bound(contacts->bonds.begin(), contacts->bonds.end(), bond,
                                     [](const Bond& a, const Bond& b) { return Key(a) < Key(b); });
    if (at != contacts->bonds.end() && Key(*at) == Key(bond)) {
      // The contact point may have moved: what it held, it keeps.
      for (int k = 0; k < 3; ++k) bond.vertices[k] = std::max(bond.vertices[k], at->vertices[k]);
      *at = bond;
      ++captured;
    } else {
      captured += Insert(bond, contacts, report);
    }
  }
  report->captures += captured;
  return captured;
}

// From the triangle (or tool) to the particle's (or tissue's) side.
Vec3 Adhesive::BondNormal(const Bond& bond, const State& state) const {
  if (bond.tool >= 0) return state.tools[bond.tool].pose.orientation * bond.tool_normal;
  const Triangle& tri = model_.triangles[bond.triangle];
  const Vec3 &a = state.position_m[tri[0]], &b = state.position_m[tri[1]],
             &c = state.position_m[tri[2]];
  const Vec3 offset = state.position_m[bond.particle] -
                      (bond.weights[0] * a + bond.weights[1] * b + bond.weights[2] * c);
  const double distance = offset.norm();
  // Too near to have a direction of its own: take the triangle's.
  if (distance > 1e-3 * capture_distance_m_) return offset * (bond.gap_sign / distance);
  return (b - a).cross(c - a).normalized() * bond.side;
}

void Adhesive::Limits(int particle, const Bond& bond, const Vec3& normal, double scale) {
  Limit& limit = limit_[particle];
  if (!limit.bonded) limit = {Vec3::Zero(), 0, 0, true, false};
  limit.normal_sum += normal;
  double normal_n, shear_n;
  const AdhesiveParameters& adhesive = *model_.adhesive;
  if (bond.tool >= 0) {
    const Strength strength = bond.sticky ? model_.tools[bond.tool].strength : Strength{0, 0};
    normal_n = scale * strength.normal_pa * model_.area_m2[particle];
    shear_n = scale * strength.shear_pa * model_.area_m2[particle];
  } else if (adhesive.kappa) {
    normal_n = adhesive.kappa->kappa_adh_m * model_.mass_kg[particle] /
               (adhesive.kappa->dt_ref_s * adhesive.kappa->dt_ref_s);
    shear_n = normal_n;
  } else {
    normal_n = adhesive.strength.normal_pa * model_.area_m2[particle];
    shear_n = adhesive.strength.shear_pa * model_.area_m2[particle];
  }
  // A particle with several bonds is held by its strongest.
  limit.normal_n = std::max(limit.normal_n, normal_n);
  limit.shear_n = std::max(limit.shear_n, shear_n);
}

void Adhesive::CollectLimits(const State& state, std::span<const double> strength_scale,
                             const Contacts& contacts) {
  for (int p : contacts.zone_members) limit_[p].bonded = false;
  for (const Bond& bond : contacts.bonds) {
    const Vec3 normal = BondNormal(bond, state);
    const double scale = bond.tool >= 0 ? strength_scale[bond.tool] : 1;
    if (bond.particle >= 0) Limits(bond.particle, bond, normal, scale);
    // A tool's normal already points to the tissue; a triangle's corners are on the other side of
    // theirs.
    const Vec3 corner_normal = bond.tool >= 0 ? normal : Vec3(-normal);
    for (int k = 0; k < 3; ++k) {
      if (bond.vertices[k] >= 0)
        Limits(bond.vertices[k], bond, bond.weights[k] * corner_normal, scale);
    }
  }
}

// A rigid body's own particles carry its inner forces too, so that only the resultant is
// meaningful: spread it over its colliding particles by area.
void Adhesive::SpreadOverRigidBodies(std::span<const Vec3> load_n, const Contacts& contacts) {
  for (int p : contacts.zone_members) load_n_[p] = load_n[p];
  for (const Body& body : model_.bodies) {
    if (!body.rigid || body.all_fixed) continue;
    Vec3 resultant = Vec3::Zero();
    double area = 0;
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      resultant += load_n[p];
      if (limit_[p].bonded) area += model_.area_m2[p];
    }
    for (int p = body.first_particle; p < body.first_particle + body.particle_count && area > 0;
         ++p) {
      load_n_[p] = resultant * (model_.area_m2[p] / area);
    }
  }
}

// Load over strength: above 1 lets go.
double Adhesive::LoadRatio(int particle, const Vec3& load) const {
  const Limit& limit = limit_[particle];
  const double length = limit.normal_sum.norm();
  if (!(length > 0)) return 0;
  const Vec3 normal = limit.normal_sum / length;
  const double tension = load.dot(normal);
  if (tension <= 0) return 0;
  const double shear = (load - tension * normal).norm();
  const auto over = [](double force, double strength) {
    if (force == 0) return 0.0;
    return strength > 0 ? force / strength : std::numeric_limits<double>::infinity();
  };
  const double normal_ratio = over(tension, limit.normal_n),
               shear_ratio = over(shear, limit.shear_n);
  return std::sqrt(normal_ratio * normal_ratio + shear_ratio * shear_ratio);
}

int Adhesive::Release(std::span<const Vec3> load_n, const State& state,
                      std::span<const double> strength_scale, Contacts* contacts) {
  if (contacts->bonds.empty()) return 0;
  CollectLimits(state, strength_scale, *contacts);
  SpreadOverRigidBodies(load_n, *contacts);
  int released = 0;
  for (Zone& zone : contacts->zones) {
    zone.load = 0;
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int p = contacts->zone_members[k];
      if (!limit_[p].bonded || model_.fixed[p]) continue;
      const double ratio = LoadRatio(p, load_n_[p]);
      zone.load = std::max(zone.load, ratio);
      if (ratio > 1) {
        limit_[p].released = true;
        ++released;
      }
    }
  }
  if (released > 0) RemoveReleased(state, contacts);
  return released;
}

void Adhesive::RemoveReleased(const State& state, Contacts* contacts) {
  for (Bond& bond : contacts->bonds) {
    const Triangle& tri = model_.triangles[bond.triangle];
    double gap = 0;
    if (bond.particle >= 0) {
      Vec3 offset = state.position_m[bond.particle];
      for (int k = 0; k < 3; ++k) offset -= bond.weights[k] * state.position_m[tri[k]];
      gap = bond.gap_sign * offset.norm();
    }
    const bool whole = bond.particle >= 0 && limit_[bond.particle].released;
    if (whole) AddReleased(bond.particle, model_.body_of[tri[0]], gap, contacts);
    for (std::int32_t& v : bond.vertices) {
      if (v < 0 || !(whole || limit_[v].released)) continue;
      if (limit_[v].released) {
        const int other = bond.tool >= 0 ? ToolKey(bond.tool) : model_.body_of[bond.particle];
        AddReleased(v, other, gap, contacts);
      }
      v = -1;
    }
    if (bond.particle >= 0 && bond.vertices == std::array<std::int32_t, 3>{-1, -1, -1}) {
      AddReleased(bond.particle, model_.body_of[tri[0]], gap, contacts);
    }
  }
  std::erase_if(contacts->bonds, [](const Bond& bond) {
    return bond.vertices == std::array<std::int32_t, 3>{-1, -1, -1};
  });
}

int Adhesive::ReleaseTool(int tool, Contacts* contacts) {
  return static_cast<int>(
      std::erase_if(contacts->bonds, [&](const Bond& bond) { return bond.tool == tool; }));
}

}  // namespace adhesim
