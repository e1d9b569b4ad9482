#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/contact/body_pairs.h"
#include "core/model/disjoint_sets.h"
#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Which bodies fall asleep and which wake (docs/decisions/0019), by the state alone: where a
// session was saved and restored makes no difference.
//
// Two bodies are neighbours when their boxes are within the reach of contact, or a zone that can
// move holds both; what cannot move is nobody's neighbour. Neighbours, and theirs, are an island.
// A body is calm when none of its particles is faster than permitted, and what drives it would not
// make it so in the time that is asked for: what creeps through something viscous is slow for long.
// An island falls asleep when each of its bodies has been calm for so long, no tool is near, and
// none of its contacts slides, and where a field pulls at it something fixed holds it. A sleeper
// wakes when it has a neighbour that is awake or a tool is near: whatever contact could see.
class Sleeping {
 public:
  // Boxes are within reach_m of each other, or not: that of contact, 0 without.
  // `together`: all that can move falls asleep at once, or nothing, and wakes at once.
  Sleeping(const Model& model, double reach_m, bool together);

  // Everything is awake.
  static void Start(const Model& model, State* state);
  // Capacities: copies have only their size.
  static void Reserve(const Model& model, State* state);

  // Wakes what has company. `pairs` are all bodies that may be within reach of each other, `tools`
  // the boxes around tools that may touch. True: there were some.
  bool Wake(std::span<const BodyPair> pairs, std::span<const Aabb> tools, State* state);
  void WakeAll(State* state);
  // Of the positions now, by kind [#particles, or empty].
  struct Forces {
    std::span<const Vec3> elastic_n, field_n;
  };
  // Counts calm steps, once a step; returns the bodies [ascending] of islands that now fall asleep.
  std::span<const std::int32_t> Tire(std::span<const BodyPair> pairs, std::span<const Aabb> tools,
                                     const Forces& forces, State* state);
  // They sleep. The caller has booked and stopped them, and says what they carry.
  void PutToSleep(std::span<const std::int32_t> bodies, std::span<const Vec3> load_n,
                  std::span<const double> strain_energy_j, State* state);
  // Says of each zone whether it holds sleepers: whenever zones are new.
  void MarkZones(State* state) const;

 private:
  bool CanMove(int body) const { return !model_.bodies[body].all_fixed; }
  void MeasureBoxes(State* state) const;
  bool Near(const Sleep& sleep, int a, int b) const {
    return sleep.box_m[a].Grown(reach_m_).Overlaps(sleep.box_m[b]);
  }
  bool IsCalm(const Body& body, const Forces& forces, const State& state) const;
  bool PinsLock(const Contacts& contacts, const Zone& zone, std::span<const Vec3> position_m) const;
  bool WakeZones(State* state) const;
  void KeepAwake(const Contacts& contacts, std::span<const Aabb> tools, const Sleep& sleep);
  void Join(std::span<const BodyPair> pairs, const State& state);
  void KeepFallersAwake(std::span<const Vec3> field_n, const Contacts& contacts);
  void Unite(int a, int b);
  void Update(State* state) const;

  const Model& model_;
  double reach_m_;
  bool together_;
  std::int32_t tired_after_;                 // calm looks
  DisjointSets islands_;                     // of bodies
  std::vector<std::uint8_t> kept_awake_;     // [#bodies] by itself; at roots, of the island
  std::vector<std::uint8_t> held_, pulled_;  // [#bodies] at roots, of the island
  std::vector<std::int32_t> tired_;
  bool rubs_ = false;  // friction gives what is fixed impulses to book
};

}  // namespace adhesim
