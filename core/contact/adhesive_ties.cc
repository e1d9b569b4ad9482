// The part of the adhesive that is about ties: bonds of deformable bodies without a zone.

#include <algorithm>
#include <cmath>

#include "core/contact/adhesive.h"
#include "core/contact/zone_builder.h"
#include "core/model/tie_geometry.h"

namespace adhesim {
namespace {

// Sizes that differ by less are equal: copies of a mesh differ by where they are.
constexpr double kEqual = 1e-6;

}  // namespace

// Mean area of a particle of each body's surface.
void Adhesive::MeasureMeshes() {
  for (const Body& body : model_.bodies) {
    double area_m2 = 0;
    int count = 0;
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      area_m2 += model_.area_m2[p];
      count += model_.area_m2[p] > 0;
    }
    mesh_area_m2_.push_back(area_m2 / std::max(count, 1));
  }
}

bool Adhesive::Ties(int body, int other) const {
  const auto soft = [this](int b) {
    return !model_.bodies[b].rigid && !model_.bodies[b].all_fixed;
  };
  return model_.adhesive->ties && body != other && soft(body) && soft(other);
}

// Particles of both sides tied to each other's triangles would leave the surfaces hardly a
// motion but affine ones: those of the finer mesh are, or of the body whose name comes first.
bool Adhesive::TiesParticlesOf(int body, int other) const {
  const double own = mesh_area_m2_[body], others = mesh_area_m2_[other];
  if (std::abs(own - others) > kEqual * std::max(own, others)) return own < others;
  return model_.bodies[body].name < model_.bodies[other].name;
}

bool Adhesive::IsTied(int particle, int body, const Contacts& contacts) const {
  auto it = std::lower_bound(contacts.bonds.begin(), contacts.bonds.end(), particle,
                             [](const Bond& bond, int p) { return bond.particle < p; });
  for (; it != contacts.bonds.end() && it->particle == particle; ++it) {
    if (it->tied && it->partner < 0 && model_.body_of[model_.triangles[it->triangle][0]] == body)
      return true;
  }
  return false;
}

void Adhesive::Tie(std::span<const Vec3> position_m, Contacts* contacts) const {
  if (!model_.adhesive->ties) return;
  for (Bond& bond : contacts->bonds) {
    if (bond.tied || bond.tool >= 0) continue;
    const int body = model_.body_of[bond.particle];
    if (!Ties(body, model_.body_of[model_.triangles[bond.triangle][0]])) continue;
    bond.tied = true;
    const TieGeometry geometry = TieGeometryOf(bond, model_, position_m);
    bond.tie_offset_m = geometry.frame.transpose() * geometry.offset_m;
    bond.tie_force_n.setZero();
  }
}

// What only keeps surfaces apart (CaptureCrossing) carries no tension.
int Adhesive::ReleaseTies(std::span<const TieLoad> loads, const State& state, double chance_s,
                          const Contacts& contacts) {
  int released = 0;
  for (const auto& [b, load_n] : loads) {
    const Bond& bond = contacts.bonds[b];
    const bool apart_only = bond.calm == ZoneBuilder::kAcrossPatches;
    const BondLimit one = apart_only ? BondLimit{} : LimitOf(bond, bond.particle, model_);
    const Limit limit{
        BondNormal(bond, state), one.normal_n, one.shear_n, false, true, false, false};
    const Demand demand = DemandOn(limit, load_n);
    if (demand.ratio <= 1 && !TakenByChance(bond.particle, demand, load_n, chance_s, contacts))
      continue;
    bond_verdict_[b] = kLetsGo;
    ++released;
  }
  return released;
}

}  // namespace adhesim
