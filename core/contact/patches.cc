#include "core/contact/patches.h"

#include <cmath>
#include <numeric>
#include <utility>

namespace adhesim {

Patches::Patches(const Model& model) : model_(model) {
  if (!model.adhesive || !model.adhesive->patch_size_m) return;
  parent_.resize(model.rest_position_m.size());
  cube_.resize(model.rest_position_m.size());
}

int Patches::FirstOf(int particle) {
  while (parent_[particle] != particle) {
    parent_[particle] = parent_[parent_[particle]];
    particle = parent_[particle];
  }
  return particle;
}

// The lower particle becomes the root, so that the result does not depend on the order.
void Patches::Unite(int a, int b) {
  a = FirstOf(a);
  b = FirstOf(b);
  if (b < a) std::swap(a, b);
  parent_[b] = a;
}

void Patches::Mark(const Contacts& contacts) {
  std::iota(parent_.begin(), parent_.end(), 0);
  for (const Bond& bond : contacts.bonds) {
    if (bond.tool >= 0 || bond.sliding) continue;
    int heaviest = -1;
    for (int k = 0; k < 3; ++k) {
      if (bond.vertices[k] >= 0 && (heaviest < 0 || bond.weights[k] > bond.weights[heaviest]))
        heaviest = k;
    }
    const bool partner = bond.holds_partner && (!bond.holds_particle || bond.partner_weight > 0.5);
    if (heaviest >= 0) Unite(partner ? bond.partner : bond.particle, bond.vertices[heaviest]);
  }
  const double size = *model_.adhesive->patch_size_m;
  for (int p = 0; p < model_.particle_count(); ++p) {
    const Vec3& rest = model_.rest_position_m[FirstOf(p)];
    for (int k = 0; k < 3; ++k) cube_[p][k] = static_cast<std::int32_t>(std::floor(rest(k) / size));
  }
}

}  // namespace adhesim
