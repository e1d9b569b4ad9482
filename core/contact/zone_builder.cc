#include "core/contact/zone_builder.h"

#include <algorithm>

namespace adhesim {

ZoneBuilder::ZoneBuilder(const Model& model) : model_(model), carried_(model), patches_(model) {
  const std::size_t nodes = model.rest_position_m.size() + model.bodies.size() + model.tools.size();
  sets_ = DisjointSets(nodes);
  prescriber_.resize(nodes);
  zone_at_root_.resize(nodes);
  member_.resize(model.rest_position_m.size());
  colliding_.resize(model.rest_position_m.size());
  old_zone_of_.resize(model.rest_position_m.size());
  for (auto* array : {&old_id_, &old_size_, &shared_, &heir_, &heir_shared_})
    array->reserve(model.rest_position_m.size());
}

void ZoneBuilder::Reserve(const Model& model, Contacts* contacts) {
  const std::size_t n = model.rest_position_m.size();
  contacts->bonds.reserve(4 * n + 64);
  contacts->released.reserve(4 * n + 64);
  contacts->zones.reserve(n);
  contacts->zone_members.reserve(n);
  contacts->zone_of.assign(n, -1);
}

bool ZoneBuilder::Unite(int a, int b) {
  const int pa = prescriber_[sets_.Root(a)], pb = prescriber_[sets_.Root(b)];
  if (pa != kNobody && pb != kNobody && pa != pb) return false;
  prescriber_[sets_.Unite(a, b).root] = pa != kNobody ? pa : pb;
  return true;
}

bool ZoneBuilder::UniteCarriers(int particle) {
  const CarriedParticle* c = carried_.Find(particle);
  for (int k = 0; c && k < 4; ++k) {
    if (c->weights[k] != 0 && !Unite(particle, c->carriers[k])) return false;
  }
  return true;
}

// All or nothing: carriers that stayed united after a refusal would be held by what nobody sees.
bool ZoneBuilder::UniteMember(int anchor, int particle) {
  int prescriber = prescriber_[sets_.Root(anchor)];
  const auto agrees = [&](int node) {
    const int other = prescriber_[sets_.Root(node)];
    if (prescriber == kNobody) prescriber = other;
    return other == kNobody || other == prescriber;
  };
  bool all = agrees(particle);
  const CarriedParticle* c = carried_.Find(particle);
  for (int k = 0; c && k < 4; ++k) all = all && (c->weights[k] == 0 || agrees(c->carriers[k]));
  return all && UniteCarriers(particle) && Unite(anchor, particle);
}

void ZoneBuilder::MarkMember(int particle) {
  member_[particle] = 1;
  const CarriedParticle* c = carried_.Find(particle);
  for (int k = 0; c && k < 4; ++k) {
    if (c->weights[k] != 0) member_[c->carriers[k]] = 1;
  }
}

bool ZoneBuilder::Rebuild(Contacts* contacts, StepReport* report) {
  sets_.Reset();
  std::fill(prescriber_.begin(), prescriber_.end(), kNobody);
  std::fill(member_.begin(), member_.end(), 0);
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (model_.fixed[p]) prescriber_[p] = kGround;
  }
  for (int t = 0; t < static_cast<int>(model_.tools.size()); ++t) prescriber_[ToolNode(t)] = t;
  UniteRigidBodies();
  if (!patches_.empty()) MarkPatches(*contacts);
  UniteBonds(contacts, report);
  UniteMeshEdges();
  old_zone_of_ = contacts->zone_of;
  old_id_.clear();
  old_size_.clear();
  for (const Zone& zone : contacts->zones) {
    old_id_.push_back(zone.id);
    old_size_.push_back(zone.count);
  }
  CollectZones(contacts);
  return KeepIds(contacts) < static_cast<int>(old_id_.size());
}

// What goes together sticks together, whatever the cubes.
void ZoneBuilder::MarkPatches(const Contacts& contacts) {
  patches_.Mark(contacts);
  for (int p = 0; p < model_.particle_count(); ++p) Unite(p, patches_.FirstOf(p));
}

// What carries a particle can be held by others already: then this bond cannot hold it.
void ZoneBuilder::KeepCarriersTogether(Bond* bond, StepReport* report) {
  if (bond->holds_particle && !UniteMember(bond->particle, bond->particle)) {
    bond->holds_particle = false;
    report->bits |= kStepZoneSplitForced;
  }
  if (bond->holds_partner && !UniteMember(bond->partner, bond->partner)) {
    bond->holds_partner = false;
    report->bits |= kStepZoneSplitForced;
  }
}

void ZoneBuilder::UniteBonds(Contacts* contacts, StepReport* report) {
  // Particles first: what is stuck to the ground stays there, and a tool that grips it too is
  // refused.
  for (const bool tools : {false, true}) {
    for (Bond& bond : contacts->bonds) {
      if ((bond.tool >= 0) != tools || bond.sliding || bond.tied) continue;
      if (!tools) KeepCarriersTogether(&bond, report);
      if (!bond.Holds()) continue;
      const bool whole = tools || bond.calm == kAcrossPatches;
      const int anchor = tools                 ? ToolNode(bond.tool)
                         : bond.holds_particle ? bond.particle
                                               : bond.partner;
      if (bond.holds_particle && bond.holds_partner &&
          (whole || InOnePatch(bond.particle, bond.partner)))
        Unite(bond.particle, bond.partner);
      for (std::int32_t& v : bond.vertices) {
        if (v < 0 || !(whole || InOnePatch(anchor, v))) continue;
        if (!UniteMember(anchor, v)) {
          v = -1;
          report->bits |= kStepZoneSplitForced;
        }
      }
    }
  }
  std::erase_if(contacts->bonds, [](const Bond& bond) { return !bond.Holds(); });
  std::fill(colliding_.begin(), colliding_.end(), 0);
  for (const Bond& bond : contacts->bonds) {
    bond.ForEachMember([&](int p) {
      colliding_[p] = 1;
      if (!bond.sliding && !bond.tied) MarkMember(p);
    });
  }
  contacts->colliding_particles =
      static_cast<int>(std::count(colliding_.begin(), colliding_.end(), 1));
}

void ZoneBuilder::UniteRigidBodies() {
  for (int b = 0; b < static_cast<int>(model_.bodies.size()); ++b) {
    const Body& body = model_.bodies[b];
    if (!body.rigid || body.all_fixed) continue;
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p)
      Unite(p, BodyNode(b));
  }
}

void ZoneBuilder::UniteMeshEdges() {
  for (const Body& body : model_.bodies) {
    if (!body.rigid || body.all_fixed) continue;
    std::fill_n(member_.begin() + body.first_particle, body.particle_count, 1);
  }
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (!member_[p]) continue;
    for (int k = model_.neighbour_start[p]; k < model_.neighbour_start[p + 1]; ++k) {
      const int q = model_.neighbours[k];
      // Neighbours that different tools hold stay apart: that is how a tissue is pulled two ways.
      if (q > p && member_[q] && InOnePatch(p, q)) Unite(p, q);
    }
  }
}

void ZoneBuilder::CollectZones(Contacts* contacts) {
  std::fill(zone_at_root_.begin(), zone_at_root_.end(), -1);
  contacts->zones.clear();
  for (int p = 0; p < model_.particle_count(); ++p) {
    contacts->zone_of[p] = -1;
    if (!member_[p]) continue;
    int& zone_index = zone_at_root_[sets_.Root(p)];
    if (zone_index < 0) {
      zone_index = static_cast<int>(contacts->zones.size());
      contacts->zones.emplace_back();
      const int prescriber = prescriber_[sets_.Root(p)];
      contacts->zones.back().tool = prescriber >= 0 ? prescriber : -1;
    }
    contacts->zone_of[p] = zone_index;
    Zone& zone = contacts->zones[zone_index];
    ++zone.count;
    zone.pins += model_.fixed[p];
    const int b = model_.body_of[p];
    if (model_.bodies[b].rigid && zone.rigid_body < 0) zone.rigid_body = b;
  }
  int first = 0;
  for (Zone& zone : contacts->zones) {
    zone.first = first;
    first += zone.count;
    zone.count = 0;
  }
  contacts->zone_members.resize(first);
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (contacts->zone_of[p] < 0) continue;
    Zone& zone = contacts->zones[contacts->zone_of[p]];
    contacts->zone_members[zone.first + zone.count++] = p;
  }
  for (Zone& zone : contacts->zones) {
    // Members are ascending, and so are their bodies.
    int last = -1;
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int body = model_.body_of[contacts->zone_members[k]];
      zone.bodies += body != last;
      last = body;
    }
  }
}

int ZoneBuilder::KeepIds(Contacts* contacts) {
  int whole = 0;
  const int old_count = static_cast<int>(old_id_.size());
  shared_.assign(old_count, 0);
  heir_.assign(old_count, -1);
  heir_shared_.assign(old_count, 0);
  // Each new zone claims the old zone it shares most members with (the lowest number, if
  // several)...
  for (int z = 0; z < static_cast<int>(contacts->zones.size()); ++z) {
    const Zone& zone = contacts->zones[z];
    int best = -1;
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int old = old_zone_of_[contacts->zone_members[k]];
      if (old < 0) continue;
      const int count = ++shared_[old];
      if (best < 0 || count > shared_[best] ||
          (count == shared_[best] && old_id_[old] < old_id_[best]))
        best = old;
    }
    const int best_count = best >= 0 ? shared_[best] : 0;
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int old = old_zone_of_[contacts->zone_members[k]];
      if (old < 0) continue;
      whole += shared_[old] == old_size_[old];
      shared_[old] = 0;
    }
    // ... and the claimant with the most gets it (the first, if several).
    if (best >= 0 && best_count > heir_shared_[best]) {
      heir_[best] = z;
      heir_shared_[best] = best_count;
    }
  }
  for (Zone& zone : contacts->zones) zone.id = -1;
  for (int old = 0; old < old_count; ++old) {
    if (heir_[old] >= 0) contacts->zones[heir_[old]].id = old_id_[old];
  }
  for (Zone& zone : contacts->zones) {
    if (zone.id < 0) zone.id = contacts->next_zone_id++;
  }
  return whole;
}

}  // namespace adhesim
