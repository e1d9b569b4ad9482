#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

// What a tool is and feels after a step.
struct ToolFrame {
  Pose pose;        // where it is
  Pose target;      // where it was told to be
  Twist twist;      // of its tip
  Wrench tissue;    // force and torque of tissue on the tool, about the tip
  Wrench coupling;  // force and torque of the virtual coupling on the tool, about the tip
  std::int32_t colliding_particles = 0;
  double contact_area_m2 = 0;  // area at rest of the particles that move with it
  double depth_m = 0;  // mean way of those particles from rest along the tool's axis: > 0 pushed in
  double force_error_n = -1;  // bound of what the implicit solver left open in `tissue`; < 0: none
  double torque_error_nm = -1;
  Mat3 stiffness_n_m = Mat3::Zero();  // of the tissue force against motions of the tip
  std::uint32_t flags = 0;            // ToolFlag bits
};

enum ToolFlag : std::uint32_t {
  kToolSpeedLimited = 1u << 0,  // held back by max_speed_m_s
  kToolForceLimited = 1u << 1,  // held back by max_force_n or max_torque_nm
  kToolObstructed = 1u << 2,    // stopped by a fixed obstacle or another tool
  kToolTargetJumped = 1u << 3,  // the target moved further in this step than the tool goes in 0.1 s
  kToolOperatorLost = 1u << 4,  // set by the session: no pose for a while
  kToolRetracted = 1u << 5,     // out of contact by command
};

// A virtual adhesive, or any other group that moves as one.
struct ZoneFrame {
  std::int32_t id = 0;  // keeps its number while the zone lives
  std::int32_t members = 0;
  std::int32_t bodies = 0;
  std::int32_t tool = -1;  // the tool that drives it, or -1
  Vec3 centre_m = Vec3::Zero();
  double load = 0;  // largest member load over its strength; 1 lets go
};

// What contact exerts on a colliding particle.
struct ContactForce {
  std::uint32_t particle = 0;
  std::array<float, 3> force_n{};
};
static_assert(sizeof(ContactForce) == 16);  // streamed as it is

// A contact that holds or slides.
struct ContactFrame {
  Vec3 point_m = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  // unit, towards the side of `body`
  double normal_force_n = 0;   // on that side, along it: > 0 pressed, < 0 pulled
  double tangential_force_n = 0;
  double margin = 1;       // 1: unloaded, 0: about to let go
  std::int32_t zone = -1;  // ZoneFrame::id; -1: it slides
  std::int32_t body = -1;
  std::int32_t other_body = -1;  // -1: a tool
  std::int32_t tool = -1;
};

// Bits of StepReport::bits; each says which limit to raise.
enum StepBit : std::uint32_t {
  kStepNonFinite =
      1u << 0,  // the state became non-finite: the engine is frozen, nothing is published
  kStepBondCapacity = 1u << 1,       // more contacts than the engine reserved
  kStepReleasePasses = 1u << 2,      // releases continued into the next step
  kStepVolumeNotMet = 1u << 3,       // the volume iteration did not converge
  kStepSubstepLimit = 1u << 4,       // something moved or turned further in a sub-step than it may
  kStepZoneSplitForced = 1u << 5,    // tools or pins that disagree met in one zone; it was split
  kStepCandidateCapacity = 1u << 6,  // more near pairs than the engine reserved
  kStepOverlap = 1u << 7,            // bodies that overlap are being separated
  kStepNotConverged = 1u << 8,       // the implicit solver stopped at its limit of iterations
};

// What happened in a step.
struct StepReport {
  std::uint32_t bits = 0;     // StepBit
  std::int32_t captures = 0;  // bonds made
  std::int32_t releases = 0;  // particles that let go
  std::int32_t sleeping = 0;  // bodies asleep at its end
};

// The state as it leaves the engine after a step: immutable once published. All arrays are sized at
// creation.
struct Frame {
  std::uint64_t step = 0;
  double time_s = 0;
  StepReport report;
  std::vector<float> position_m;      // [#particles x 3]
  std::vector<std::int32_t> zone_of;  // [#particles] ZoneFrame::id, or -1
  std::vector<ZoneFrame> zones;       // capacity fixed; size varies
  std::vector<ToolFrame> tools;       // [#tools]
  std::int32_t colliding_particles = 0;
  double kinetic_energy_j = 0;
  // Of particles that can move and are deformable, ascending; capacity fixed, size varies. In the
  // last sub-step.
  std::vector<ContactForce> contact_forces;
  std::vector<ContactFrame> contacts;  // likewise; ascending by bond
  // [#particles] each one's share of the elastic energy, J, where forces were evaluated last; empty
  // when no effect is elastic.
  std::vector<float> strain_energy_j;
};

}  // namespace adhesim
