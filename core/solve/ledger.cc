#include "core/solve/ledger.h"

#include <algorithm>
#include <cmath>

#include "core/model/awake.h"
#include "core/solve/subspace_solver.h"

namespace adhesim {
namespace {

double KineticEnergy(const Model& model, std::span<const Vec3> velocity_m_s,
                     const AwakeRanges& awake) {
  double twice = 0;
  for (const auto& [begin, end] : awake) {
    for (int p = begin; p < end; ++p) twice += model.mass_kg[p] * velocity_m_s[p].squaredNorm();
  }
  return 0.5 * twice;
}

void UpdateScales(const Model& model, State* state) {
  double linear = 0, angular = 0;
  for (const auto& [begin, end] : AwakeRanges(model.particle_count(), state->sleep)) {
    for (int p = begin; p < end; ++p) {
      const double momentum = model.mass_kg[p] * state->velocity_m_s[p].norm();
      linear += momentum;
      angular += state->position_m[p].norm() * momentum;
    }
  }
  state->momentum.scale_linear = std::max(state->momentum.scale_linear, linear);
  state->momentum.scale_angular = std::max(state->momentum.scale_angular, angular);
}

// Linear and angular (about the world's origin) momentum from outside.
struct Impulses {
  Vec3 linear = Vec3::Zero();
  Vec3 angular = Vec3::Zero();
};

void AddImpulses(const Impulses& got, State* state) {
  state->momentum.impulse_linear += got.linear;
  state->momentum.impulse_angular += got.angular;
}

// Impulse and moment (about a point) that a zone's members got beyond the forces on them.
struct Held {
  Vec3 impulse = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
};

// Change of kinetic energy when a driven group turns under a constant twist: its centre and its
// inertia turn with it.
double DrivenTurn(const RigidGroup& group) {
  const Vec3 r = group.centre_m - group.pivot_m;
  const Vec3& w = group.twist.angular_rad_s;
  const Mat3 turned = group.rotation * group.inertia * group.rotation.transpose();
  return group.mass_kg * group.twist.linear_m_s.dot(w.cross(group.rotation * r - r)) +
         0.5 * w.dot((turned - group.inertia) * w);
}

// What it takes is booked by itself: zones that sleep are not looked at.
bool IsHeldAlone(const Model& model, const Contacts& contacts, int particle) {
  const int z = contacts.zone_of[particle];
  return model.fixed[particle] && (z < 0 || contacts.zones[z].asleep);
}

}  // namespace

void OpenLedgers(const Model& model, State* state) {
  state->ledger = {};
  state->momentum = {};
  const AwakeRanges awake(model.particle_count(), state->sleep);
  state->ledger.kinetic_j = KineticEnergy(model, state->velocity_m_s, awake);
  for (int p = 0; p < model.particle_count(); ++p) {
    const Vec3 momentum = model.mass_kg[p] * state->velocity_m_s[p];
    state->momentum.initial_linear += momentum;
    state->momentum.initial_angular += state->position_m[p].cross(momentum);
  }
  UpdateScales(model, state);
}

void BookElastic(double elastic_j, State* state) {
  Ledger& ledger = state->ledger;
  if (ledger.reference_j == 0 && state->step == 0) {
    // The first look for contacts comes before the first forces.
    ledger.initial_j = ledger.kinetic_j + elastic_j + ledger.captured_j - ledger.tool_work_j;
  }
  ledger.numerical_j -= elastic_j - ledger.elastic_j + ledger.elastic_work_j;
  if (ledger.reference_j == 0 && state->step == 0) ledger.numerical_j = 0;
  ledger.elastic_j = elastic_j;
  ledger.elastic_work_j = 0;
  ledger.reference_j = std::max(ledger.reference_j, ledger.kinetic_j + elastic_j);
}

void BookCorrection(const Model& model, std::span<const Vec3> before_m, double elastic_j,
                    State* state) {
  Ledger& ledger = state->ledger;
  ledger.correction_j += elastic_j - ledger.elastic_j;
  ledger.elastic_j = elastic_j;
  ledger.reference_j = std::max(ledger.reference_j, ledger.kinetic_j + elastic_j);
  Impulses moved;
  for (int p = 0; p < model.particle_count(); ++p) {
    moved.angular +=
        (state->position_m[p] - before_m[p]).cross(Vec3(model.mass_kg[p] * state->velocity_m_s[p]));
  }
  AddImpulses(moved, state);
}

void BookSleep(const Model& model, const Body& body, State* state) {
  Impulses got;
  double twice_loss = 0;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    const Vec3 momentum = model.mass_kg[p] * state->velocity_m_s[p];
    twice_loss += momentum.dot(state->velocity_m_s[p]);
    got.linear -= momentum;
    got.angular -= state->position_m[p].cross(momentum);
  }
  AddImpulses(got, state);
  state->ledger.captured_j += 0.5 * twice_loss;
  state->ledger.kinetic_j -= 0.5 * twice_loss;
}

// An orthogonal projection in the metric of the masses: T' - T = -1/2 |v' - v|_M^2 plus the work of
// tools, whose impulse on a member is m (v' - v) less what the constraints gave it.
void BookCapture(const Model& model, const SubspaceSolver& solver, State* state,
                 std::span<Wrench> tool_impulse) {
  Ledger& ledger = state->ledger;
  const std::span<const Vec3> after = solver.kicked_velocity_m_s();
  Impulses sum;
  double twice_loss = 0;
  const AwakeRanges awake(model.particle_count(), state->sleep);
  for (const auto& [begin, end] : awake) {
    for (int p = begin; p < end; ++p) {
      twice_loss += model.mass_kg[p] * (after[p] - state->velocity_m_s[p]).squaredNorm();
      if (IsHeldAlone(model, state->contacts, p)) {
        const Vec3 impulse = -solver.ConstraintImpulse(p) - solver.TieImpulse(p);
        sum.linear += impulse;
        sum.angular += state->position_m[p].cross(impulse);
      }
    }
  }
  double tool_work = 0;
  for (std::size_t z = 0; z < state->contacts.zones.size(); ++z) {
    const Zone& zone = state->contacts.zones[z];
    const RigidGroup& group = solver.groups()[z];
    if (zone.asleep || (zone.pins == 0 && !group.driven())) continue;
    Held got;
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int p = state->contacts.zone_members[k];
      const Vec3 impulse = model.mass_kg[p] * (after[p] - state->velocity_m_s[p]) -
                           solver.ConstraintImpulse(p) - solver.TieImpulse(p);
      got.impulse += impulse;
      got.moment += (state->position_m[p] - group.pivot_m).cross(impulse);
    }
    sum.linear += got.impulse;
    sum.angular += group.pivot_m.cross(got.impulse) + got.moment;
    if (group.driven()) {
      tool_impulse[zone.tool].force_n -= got.impulse;
      tool_impulse[zone.tool].torque_nm -= got.moment;
      tool_work +=
          got.impulse.dot(group.twist.linear_m_s) + got.moment.dot(group.twist.angular_rad_s);
    }
  }
  AddImpulses(sum, state);
  twice_loss += 2 * solver.TieGivingLoss();
  ledger.captured_j += 0.5 * twice_loss;
  ledger.tool_work_j += tool_work;
  ledger.abs_tool_j += std::abs(tool_work);
  const double kinetic = KineticEnergy(model, after, awake);
  ledger.worst_j =
      std::max(ledger.worst_j, std::abs(kinetic - ledger.kinetic_j - tool_work + 0.5 * twice_loss));
  ledger.kinetic_j = kinetic;
}

void BookStep(const Model& model, const ForcesByKind& forces, std::span<const Vec3> total_force_n,
              const SubspaceSolver& solver, std::span<const Twist> tool_twist, double dt_s,
              State* state, std::span<Wrench> tool_impulse) {
  Ledger& ledger = state->ledger;
  for (ToolState& tool : state->tools) tool.rubbed = {};
  // Of this sub-step alone: a particle's share would drown in the sums since the start.
  Impulses got;
  const std::span<const Vec3> x = state->position_m, v = state->velocity_m_s;
  const std::span<const Vec3> kicked = solver.kicked_velocity_m_s();
  const std::span<const Vec3> moved_x = solver.moved_position_m(),
                              moved_v = solver.moved_velocity_m_s();
  const AwakeRanges awake(model.particle_count(), state->sleep);

  // Work of forces: dt f . (v + v') / 2.
  std::array<double, kForceKinds> work{};
  for (int kind = 0; kind < kForceKinds; ++kind) {
    if (forces[kind].empty()) continue;
    double twice = 0;
    for (const auto& [begin, end] : awake) {
      for (int p = begin; p < end; ++p) twice += forces[kind][p].dot(v[p] + kicked[p]);
    }
    work[kind] = 0.5 * dt_s * twice;
    if (!((1u << kind) & (kField | kDrag))) continue;
    for (const auto& [begin, end] : awake) {
      for (int p = begin; p < end; ++p) {
        got.linear += dt_s * forces[kind][p];
        got.angular += x[p].cross(Vec3(dt_s * forces[kind][p]));
      }
    }
  }
  const double elastic = work[0], damping = work[1], field = work[2], drag = work[3];
  ledger.elastic_work_j += elastic;
  ledger.viscous_j -= damping + drag;
  ledger.external_work_j += field;
  ledger.abs_external_j += std::abs(field);

  // Impulses of the constraints, of sliding contacts and of ties, and what fixed particles outside
  // zones take.
  double volume = 0, sliding = 0, sliding_at_end = 0, ties = 0;
  for (const auto& [begin, end] : awake) {
    for (int p = begin; p < end; ++p) {
      const Vec3 constraint = solver.ConstraintImpulse(p), contact = solver.SlidingImpulse(p);
      volume += 0.5 * constraint.dot(v[p] + kicked[p]);
      sliding += 0.5 * contact.dot(v[p] + kicked[p]);
      sliding_at_end += contact.dot(kicked[p]);
      if (IsHeldAlone(model, state->contacts, p)) {
        const Vec3 impulse = -dt_s * total_force_n[p] - constraint - contact - solver.TieImpulse(p);
        got.linear += impulse;
        got.angular += x[p].cross(impulse);
      }
    }
  }
  for (int p : solver.tied()) ties += 0.5 * solver.TieImpulse(p).dot(v[p] + kicked[p]);
  // Tools: their part of it, and what comes from outside.
  double tool_work = 0;
  solver.slides().ForEachOnTool([&](const ContactRows::OnTool& on) {
    got.linear += on.impulse_ns;
    got.angular += on.point_m.cross(on.impulse_ns);
    tool_work += on.work_j;
    sliding -= on.work_j;
    sliding_at_end -= on.end_work_j;
    const Vec3 arm = on.point_m - state->tools[on.tool].pose.position_m;
    tool_impulse[on.tool].force_n -= on.impulse_ns;
    tool_impulse[on.tool].torque_nm -= arm.cross(on.impulse_ns);
    state->tools[on.tool].rubbed.force_n -= on.impulse_ns / dt_s;
    state->tools[on.tool].rubbed.torque_nm -= arm.cross(on.impulse_ns) / dt_s;
  });
  ledger.volume_j += volume;
  // Implicit forces act over dt v', and so do contacts within such a step: the rest of the kinetic
  // energy that they change is part of what backward Euler takes.
  const bool within = solver.slides().within();
  ledger.sliding_j += within ? sliding_at_end : sliding;
  if (within) ledger.numerical_j += sliding_at_end - sliding;
  ledger.tie_j += ties;

  // Zones: rotation of the free ones, tools' work, and what holds the held ones.
  double rotation = 0;
  for (std::size_t z = 0; z < state->contacts.zones.size(); ++z) {
    const Zone& zone = state->contacts.zones[z];
    const RigidGroup& group = solver.groups()[z];
    if (group.freedom == RigidGroup::Freedom::kFree ||
        group.freedom == RigidGroup::Freedom::kPoint) {
      rotation +=
          0.5 * group.angular_momentum.dot(group.end_angular_rad_s - group.twist.angular_rad_s);
    }
    if (zone.asleep || (zone.pins == 0 && !group.driven())) continue;
    Held kick, turn;
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int p = state->contacts.zone_members[k];
      const double m = model.mass_kg[p];
      const Vec3 applied = dt_s * total_force_n[p] + solver.InnerImpulse(p);
      const Vec3 kicked_by = m * (kicked[p] - v[p]) - applied;
      const Vec3 turned_by = m * (moved_v[p] - kicked[p]);
      kick.impulse += kicked_by;
      kick.moment += (x[p] - group.pivot_m).cross(kicked_by);
      turn.impulse += turned_by;
      turn.moment += (moved_x[p] - group.moved_pivot_m).cross(turned_by);
      got.linear += kicked_by + turned_by;
      got.angular += m * moved_x[p].cross(moved_v[p]) - m * x[p].cross(v[p]) - x[p].cross(applied);
    }
    if (!group.driven()) continue;
    const Twist& before = state->tools[zone.tool].twist;
    const Twist& after = tool_twist[zone.tool];
    tool_work += 0.5 * kick.impulse.dot(before.linear_m_s + after.linear_m_s) +
                 0.5 * kick.moment.dot(before.angular_rad_s + after.angular_rad_s) +
                 DrivenTurn(group);
    tool_impulse[zone.tool].force_n -= kick.impulse + turn.impulse;
    tool_impulse[zone.tool].torque_nm -= kick.moment + turn.moment;
  }
  AddImpulses(got, state);
  ledger.tool_work_j += tool_work;
  ledger.abs_tool_j += std::abs(tool_work);
  ledger.rotation_j += rotation;

  const double kinetic = KineticEnergy(model, moved_v, awake);
  const double expected =
      elastic + damping + field + drag + volume + sliding + ties + tool_work + rotation;
  ledger.worst_j = std::max(ledger.worst_j, std::abs(kinetic - ledger.kinetic_j - expected));
  ledger.kinetic_j = kinetic;
  UpdateScales(model, state);
}

}  // namespace adhesim
