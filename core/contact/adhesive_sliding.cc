// The part of the adhesive that is about contacts that slide.

#include <algorithm>
#include <limits>

#include "core/contact/adhesive.h"

namespace adhesim {

std::pair<std::int32_t, std::int32_t> Adhesive::BodiesOf(const Bond& bond) const {
  return std::minmax(model_.body_of[bond.particle],
                     model_.body_of[model_.triangles[bond.triangle][0]]);
}

int Adhesive::FollowSliding(std::span<const NearPair> near, double time_s, Contacts* contacts) {
  // All that friction holds between two bodies sticks at the same time: a few that stick would have
  // to carry everything.
  calm_.clear();
  for (const Bond& bond : contacts->bonds) {
    if (bond.tool < 0 && bond.sliding && bond.calm >= kCalm) calm_.push_back(BodiesOf(bond));
  }
  std::sort(calm_.begin(), calm_.end());
  int changes = 0;
  for (Bond& bond : contacts->bonds) {
    if (!bond.sliding || bond.tool >= 0) continue;
    if (bond.calm > 0 && std::binary_search(calm_.begin(), calm_.end(), BodiesOf(bond))) {
      bond.sliding = false;
      bond.since_s = time_s;
      ++changes;
    }
    if (bond.partner >= 0) {  // those that Capture() does not find again go
      if (bond.sliding) bond.gap_m = std::numeric_limits<double>::infinity();
      continue;
    }
    const int body = model_.body_of[model_.triangles[bond.triangle][0]];
    const auto pair = std::lower_bound(
        near.begin(), near.end(), std::pair(bond.particle, body),
        [](const NearPair& a, auto b) { return std::pair(a.particle, a.body) < b; });
    if (pair == near.end() || pair->particle != bond.particle || pair->body != body ||
        pair->gap_m > release_distance_m_) {
      bond.triangle = -1;
      ++changes;
      continue;
    }
    changes += bond.triangle != pair->triangle;
    bond.triangle = pair->triangle;
    for (int k = 0; k < 3; ++k) bond.weights[k] = pair->weights(k);
    bond.gap_m = pair->gap_m;
    bond.gap_sign = pair->gap_m < 0 ? -1 : 1;
    if (model_.bodies[body].closed) {
      bond.side = pair->side;
    } else if (pair->side != bond.side) {  // an open surface has been crossed: back to its side
      bond.gap_sign = -1;
      bond.gap_m = -pair->gap_m;
    }
    ShowMembers(&bond);
  }
  if (changes == 0) return 0;
  std::erase_if(contacts->bonds, [](const Bond& bond) { return bond.triangle < 0; });
  std::sort(contacts->bonds.begin(), contacts->bonds.end(), [](const Bond& a, const Bond& b) {
    return Key(a) != Key(b) ? KeyLess(a, b) : a.sliding < b.sliding;
  });
  // One that sticks there already takes the place of one that has slid there.
  const auto same = [](const Bond& a, const Bond& b) { return Key(a) == Key(b); };
  contacts->bonds.erase(std::unique(contacts->bonds.begin(), contacts->bonds.end(), same),
                        contacts->bonds.end());
  return changes;
}

void Adhesive::EndSliding(int b, bool held, bool parted, Contacts* contacts) {
  Bond& bond = contacts->bonds[b];
  bond.calm = held ? std::min(bond.calm + 1, kCalm) : 0;
  if (!parted) return;
  for (const std::int32_t v : bond.vertices) {
    if (bond.tool >= 0 && v >= 0) AddReleased(v, ToolKey(bond.tool), bond.gap_m, contacts);
  }
  if (bond.tool >= 0) {
    bond.triangle = -1;
    return;
  }
  AddReleased(bond.particle, model_.body_of[model_.triangles[bond.triangle][0]], bond.gap_m,
              contacts);
  bond.triangle = -1;
}

int Adhesive::FollowSlidingOnTools(std::span<const NearTool> near, const State& state,
                                   Contacts* contacts) {
  int changes = 0;
  for (int tool = 0; tool < static_cast<int>(model_.tools.size()); ++tool) {
    const auto calm = [tool](const Bond& bond) {
      return bond.tool == tool && bond.sliding && bond.calm >= kCalm;
    };
    const bool stops = std::any_of(contacts->bonds.begin(), contacts->bonds.end(), calm);
    for (Bond& bond : contacts->bonds) {
      if (bond.tool != tool || !bond.sliding) continue;
      const auto at = std::lower_bound(
          near.begin(), near.end(), std::pair(tool, bond.triangle),
          [](const NearTool& a, const auto& key) { return std::pair(a.tool, a.triangle) < key; });
      if (at == near.end() || at->tool != tool || at->triangle != bond.triangle ||
          at->gap_m > release_distance_m_) {
        bond.triangle = -1;
        ++changes;
        continue;
      }
      const std::int8_t calm_for = bond.calm;
      bond = BondOf(*at, state, *contacts);
      bond.calm = calm_for;
      if (!stops || calm_for == 0 || !bond.Holds()) continue;
      bond.sliding = false;
      ++changes;
    }
  }
  RemoveParted(contacts);
  return changes;
}

int Adhesive::RemoveParted(Contacts* contacts) {
  return static_cast<int>(
      std::erase_if(contacts->bonds, [](const Bond& bond) { return bond.triangle < 0; }));
}

}  // namespace adhesim
