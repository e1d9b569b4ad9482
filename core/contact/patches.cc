#include "core/contact/patches.h"

#include <cmath>

namespace adhesim {
namespace {

Vec3 MiddleAtRest(const Model& model, const Body& body) {
  Aabb box;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    box.Add(model.rest_position_m[p]);
  }
  return 0.5 * (box.min + box.max);
}

}  // namespace

Patches::Patches(const Model& model) : model_(model) {
  if (!model.adhesive || !model.adhesive->patch_size_m) return;
  groups_ = DisjointSets(model.rest_position_m.size());
  cube_.resize(model.rest_position_m.size());
}

void Patches::Mark(const Contacts& contacts) {
  groups_.Reset();
  for (const Bond& bond : contacts.bonds) {
    if (bond.tool >= 0 || bond.sliding || ToGround(bond, model_)) continue;
    int heaviest = -1;
    for (int k = 0; k < 3; ++k) {
      if (bond.vertices[k] >= 0 && (heaviest < 0 || bond.weights[k] > bond.weights[heaviest]))
        heaviest = k;
    }
    const bool partner = bond.holds_partner && (!bond.holds_particle || bond.partner_weight > 0.5);
    if (heaviest >= 0)
      groups_.Unite(partner ? bond.partner : bond.particle, bond.vertices[heaviest]);
  }
  const double size = *model_.adhesive->patch_size_m;
  for (int p = 0; p < model_.particle_count(); ++p) {
    const Vec3& rest = model_.rest_position_m[FirstOf(p)];
    for (int k = 0; k < 3; ++k) cube_[p][k] = static_cast<std::int32_t>(std::floor(rest(k) / size));
  }
  // On the ground a body's own cubes count, one in its middle: what is smaller is one patch.
  int last = -1;
  Vec3 middle = Vec3::Zero();
  for (const Bond& bond : contacts.bonds) {
    if (bond.tool >= 0 || bond.sliding || !ToGround(bond, model_)) continue;
    if (const int body = model_.body_of[bond.particle]; body != last) {
      middle = MiddleAtRest(model_, model_.bodies[body]);
      last = body;
    }
    for (const int p : {bond.particle, bond.partner}) {
      if (p < 0) continue;
      const Vec3 rest = (model_.rest_position_m[p] - middle) / size;
      for (int k = 0; k < 3; ++k) {
        cube_[p][k] = static_cast<std::int32_t>(std::floor(rest(k) + 0.5));
      }
    }
  }
}

}  // namespace adhesim
