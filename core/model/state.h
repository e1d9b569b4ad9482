#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// A contact that holds: a particle on a triangle, an edge on an edge of a triangle, or a tool on a
// triangle.
struct Bond {
  std::int32_t particle = -1;  // the particle, the lower end of the edge, or -1 for a tool's bond
  std::int32_t partner = -1;   // the edge's other end, or -1
  std::int32_t tool = -1;      // the tool, or -1
  std::int32_t triangle = -1;  // the triangle on the other side
  std::array<std::int32_t, 3>
      vertices{};  // its particles that are members, -1 where let go or of negligible weight
  std::array<double, 3> weights{};  // barycentric coordinates of the contact point
  double partner_weight = 0;        // w: an edge's contact point is (1 - w) particle + w partner
  bool holds_particle = true;       // they are members: neither let go nor of negligible weight
  bool holds_partner = false;
  // +1: the particle is on the side that the triangle's normal points to. Edges: the cross product
  // of the edge (from particle to partner) and the triangle's (as it goes round) points to it.
  std::int8_t side = 1;
  std::int8_t gap_sign = 1;  // -1: the particle was inside a closed body when captured
  double gap_m = 0;          // when captured; the zone keeps it
  bool sticky = true;        // false: no strength (a tool's bare shaft)
  bool sliding = false;      // its sides move along each other: no zone by it
  // Sub-steps for which friction has held it, while it slides; -1: sticks, across patches too.
  std::int8_t calm = 0;
  // Its sides are tied (TieGeometry): no zone by it, either.
  bool tied = false;
  Vec3 tie_offset_m = Vec3::Zero();  // what it keeps, in the frame of the triangle
  Vec3 tie_force_n =
      Vec3::Zero();  // on the particle's side in the last sub-step; written by `solve`
  Vec3 tool_normal = Vec3::Zero();  // tool bonds: unit, from tool to tissue, in the tool's frame
  double since_s = 0;         // simulated time at the beginning of the step in which it took hold
  double strength_scale = 1;  // what effects make of its strength, see Effect::ScaleStrengths

  // How long it has held; 0 while it slides.
  double AgeAt(double time_s) const { return sliding ? 0 : time_s - since_s; }
  // Goes on from `before`, a bond of the same features, if that held.
  void Continue(const Bond& before) {
    if (before.sliding) return;
    since_s = before.since_s;
    strength_scale = before.strength_scale;
  }

  // True while both sides have members.
  bool Holds() const {
    return (tool >= 0 || holds_particle || holds_partner) &&
           (vertices[0] >= 0 || vertices[1] >= 0 || vertices[2] >= 0);
  }
  // Calls visit(particle) for every member.
  template <typename Visit>
  void ForEachMember(const Visit& visit) const {
    if (particle >= 0 && holds_particle) visit(particle);
    if (partner >= 0 && holds_partner) visit(partner);
    for (std::int32_t v : vertices) {
      if (v >= 0) visit(v);
    }
  }
};

// The corner opposite the edge on which a point with these weights lies.
inline int OppositeCorner(const std::array<double, 3>& weights) {
  return weights[0] == 0 ? 0 : weights[1] == 0 ? 1 : 2;
}

// A pair that let go and may not stick again before it has been further apart than d_off or is
// pressed closer.
struct ReleasedPair {
  std::int32_t particle = -1;
  std::int32_t other = -1;  // body, or -1 - tool
  double gap_m = 0;         // when it let go
};

// A group of particles that moves as one rigid body.
struct Zone {
  std::int32_t id = 0;
  std::int32_t first = 0;  // into Contacts::zone_members
  std::int32_t count = 0;
  std::int32_t tool = -1;               // driven by this tool, or -1
  std::int32_t rigid_body = -1;         // holds this rigid body (the lowest, if several), or -1
  std::int32_t pins = 0;                // fixed among the members, or corners of ground under them
  std::int32_t bodies = 0;              // different bodies among the members
  Vec3 centre_m = Vec3::Zero();         // centre of mass
  Vec3 momentum_kg_m_s = Vec3::Zero();  // P
  Vec3 angular_momentum_kg_m2_s = Vec3::Zero();  // L about `centre_m`
  double load = 0;              // largest member load over its strength in the last sub-step
  bool holds_sleepers = false;  // some of its members' bodies sleep: it does not move
  bool asleep = false;          // all of them that can move do
};

// All contact that evolves. Capacities are reserved at load.
struct Contacts {
  std::vector<Bond> bonds;                 // ascending by key
  std::vector<ReleasedPair> released;      // ascending by (particle, other)
  std::vector<Zone> zones;                 // ascending by first member
  std::vector<std::int32_t> zone_members;  // [sum of counts] particles, ascending within a zone
  std::vector<std::int32_t> zone_of;       // [#particles] index into `zones`, or -1
  std::int32_t next_zone_id = 0;
  std::int32_t colliding_particles = 0;  // different particles among the bonds
  bool overlapping = false;              // bodies lie in each other since the start
  std::uint64_t draws = 0;               // sub-steps in which chance has decided
};

struct ToolState {
  Pose pose;
  Twist twist;  // of the tip
  Pose target;
  Wrench tissue;  // of tissue on the tool, about the tip, mean over the last step
  Wrench coupling;
  Wrench rubbed;  // of sliding contacts on the tool in the last sub-step, about the tip
  std::uint32_t flags = 0;
};

// Energy booked since the start; each term by its own formula (physics notes 3.7). All J.
struct Ledger {
  double initial_j = 0;        // kinetic + elastic at the start
  double external_work_j = 0;  // of gravity and attraction
  double tool_work_j = 0;      // of tools on tissue
  double captured_j = 0;       // lost when particles join a zone (>= 0)
  double viscous_j = 0;        // lost to drag and damping (>= 0)
  double rotation_j = 0;       // gained by the rotation of zones (round-off)
  double volume_j = 0;         // work of the volume constraint's impulses (second order in dt)
  double numerical_j =
      0;  // -(change of elastic energy + elastic work): lost by the time integration
  double correction_j = 0;    // gained by position corrections
  double sliding_j = 0;       // work of sliding contacts (<= 0)
  double tie_j = 0;           // work of ties (second order in dt)
  double elastic_j = 0;       // elastic energy when last evaluated
  double elastic_work_j = 0;  // of elastic forces since then
  double kinetic_j = 0;       // kinetic energy when last summed
  double reference_j = 0;     // E_ref without the work terms: max of kinetic + elastic
  double abs_external_j = 0;  // sum of |external work|
  double abs_tool_j = 0;      // sum of |tool work|
  double worst_j = 0;         // largest imbalance of one sub-step
};

// Linear and angular momentum booked since the start.
struct MomentumLedger {
  Vec3 initial_linear = Vec3::Zero();   // kg m/s
  Vec3 initial_angular = Vec3::Zero();  // about the world's origin, kg m^2/s
  Vec3 impulse_linear = Vec3::Zero();   // of fields, drag, pins and tools
  Vec3 impulse_angular = Vec3::Zero();
  double scale_linear = 0;   // max of sum m |v|
  double scale_angular = 0;  // max of sum |r| m |v|
};

// Particles [begin, end).
struct ParticleRange {
  std::int32_t begin = 0, end = 0;
};

// Which bodies sleep (docs/decisions/0019): they have no velocity, and no stage looks at them. All
// arrays are empty where the scene lets nothing sleep.
struct Sleep {
  std::vector<std::uint8_t> asleep;  // [#bodies]
  // [#bodies] steps for which nothing of it has been faster than it may.
  std::vector<std::int32_t> calm_steps;
  std::int32_t bodies = 0;           // of them sleep
  std::vector<ParticleRange> awake;  // particles of the others that matter, ascending
  // Of those that sleep, when they fell asleep:
  std::vector<Aabb> box_m;              // [#bodies] around it (others: of some time)
  std::vector<Vec3> load_n;             // [#particles] what contact carried
  std::vector<double> strain_energy_j;  // [#particles] shares of the elastic energy
  double elastic_j = 0;                 // and their sum

  bool Of(int body) const { return bodies > 0 && asleep[body]; }
};

// Everything that evolves: one copyable value. Snapshot, reset and history are copies of it.
struct State {
  std::uint64_t step = 0;
  double time_s = 0;
  std::vector<Vec3> position_m;           // [#particles] written by `move`
  std::vector<Vec3> velocity_m_s;         // [#particles] written by `move` and `zones`
  std::vector<Vec3> velocity_change_m_s;  // [#particles] in the last sub-step, written by `solve`:
                                          // where implicit steps start; empty in explicit ones
  std::vector<double>
      effect_state;              // what effects declared (rotations, damage); each knows its part
  Contacts contacts;             // written by `zones` and `solve`
  std::vector<ToolState> tools;  // [#tools] written by `tools` and `move`
  // Where explicit springs keep it: the number of sub-steps of the last step, and the last one that
  // needed more than half of it.
  std::int32_t substeps = 0;
  std::uint64_t substeps_needed_in = 0;
  Sleep sleep;  // written by `detect` (wakes) and `forces` (falls asleep)
  Ledger ledger;
  MomentumLedger momentum;
};

}  // namespace adhesim
