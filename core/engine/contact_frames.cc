#include "core/engine/contact_frames.h"

#include <algorithm>
#include <cmath>

#include "core/model/bond_geometry.h"

namespace adhesim {
namespace {

// What is left before a contact under this force lets go: pressed, everything.
double Margin(double pull_n, double shear_n, double normal_limit_n, double shear_limit_n) {
  if (!(pull_n > 0)) return 1;
  const double normal = pull_n / normal_limit_n, shear = shear_n / shear_limit_n;
  const double used = shear_n > 0 ? std::sqrt(normal * normal + shear * shear) : normal;
  return used < 1 ? 1 - used : 0;
}

}  // namespace

ContactFrames::ContactFrames(const Model& model) : model_(model) {
  if (model.adhesive) bonds_of_.resize(model.rest_position_m.size());
}

void ContactFrames::AddMember(int p, const Bond& bond, std::span<const Vec3> load_n,
                              Side* side) const {
  if (model_.fixed[p] || model_.bodies[model_.body_of[p]].rigid) {
    side->told = false;
    return;
  }
  const double share = 1.0 / bonds_of_[p];
  side->force_n -= share * load_n[p];  // what carries the load
  const BondLimit limit = LimitOf(bond, p, model_);
  side->normal_n += share * limit.normal_n;
  side->shear_n += share * limit.shear_n;
}

void ContactFrames::Write(const State& state, std::span<const Vec3> load_n,
                          std::vector<ContactFrame>* contacts) {
  std::fill(bonds_of_.begin(), bonds_of_.end(), 0);
  for (const Bond& bond : state.contacts.bonds) bond.ForEachMember([&](int p) { ++bonds_of_[p]; });
  for (const Bond& bond : state.contacts.bonds) {
    if (contacts->size() == contacts->capacity()) return;
    Side near, far;
    if (bond.particle >= 0 && bond.holds_particle) AddMember(bond.particle, bond, load_n, &near);
    if (bond.partner >= 0 && bond.holds_partner) AddMember(bond.partner, bond, load_n, &near);
    int corner = -1;
    for (const std::int32_t v : bond.vertices) {
      if (v < 0) continue;
      corner = v;
      AddMember(v, bond, load_n, &far);
    }
    ContactFrame out;
    const bool tool = bond.tool >= 0;
    const bool by_far = tool || !near.told;
    const Side& side = by_far ? far : near;
    if (!side.told) continue;
    const Vec3 force = by_far && !tool ? Vec3(-side.force_n) : side.force_n;
    if (tool) {
      out.normal = state.tools[bond.tool].pose.orientation * bond.tool_normal;
      const Triangle& triangle = model_.triangles[bond.triangle];
      for (int k = 0; k < 3; ++k) out.point_m += bond.weights[k] * state.position_m[triangle[k]];
    } else {
      const BondGeometry geometry = GeometryOf(bond, model_, state.position_m);
      out.normal = geometry.normal;
      out.point_m = geometry.point_m;
    }
    out.normal_force_n = force.dot(out.normal);
    out.tangential_force_n = (force - out.normal_force_n * out.normal).norm();
    out.margin = Margin(-out.normal_force_n, out.tangential_force_n, side.normal_n, side.shear_n);
    const int touched = model_.body_of[model_.triangles[bond.triangle][0]];
    out.body = tool ? touched : model_.body_of[bond.particle];
    out.other_body = tool ? -1 : touched;
    out.tool = bond.tool;
    const int member = bond.particle >= 0 && bond.holds_particle ? bond.particle : corner;
    if (!bond.sliding && member >= 0 && state.contacts.zone_of[member] >= 0)
      out.zone = state.contacts.zones[state.contacts.zone_of[member]].id;
    contacts->push_back(out);
  }
}

}  // namespace adhesim
