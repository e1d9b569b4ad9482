#include "core/contact/patches.h"

#include <cmath>

namespace adhesim {

Patches::Patches(const Model& model) : model_(model) {
  if (!model.adhesive || !model.adhesive->patch_size_m) return;
  groups_ = DisjointSets(model.rest_position_m.size());
  cube_.resize(model.rest_position_m.size());
}

void Patches::Mark(const Contacts& contacts) {
  groups_.Reset();
  for (const Bond& bond : contacts.bonds) {
    if (bond.tool >= 0 || bond.sliding) continue;
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
}

}  // namespace adhesim
