#pragma once

#include <array>
#include <span>

#include "core/model/effect.h"
#include "core/model/model.h"
#include "core/model/state.h"
#include "core/solve/rigid_group.h"

namespace adhesim {

class SubspaceSolver;

// Bookkeeping of energy and momentum, stage by stage (physics notes 3.7). Every term comes from its
// own formula; that the kinetic energy really changed by their sum is what `Ledger::worst_j` checks
// in every sub-step.

// Forces of a sub-step apart by kind, N, [#particles] each; empty: the scene has none of that kind.
using ForcesByKind = std::array<std::span<const Vec3>, kForceKinds>;

// Sets both ledgers at the start of a scene.
void OpenLedgers(const Model& model, State* state);

// The elastic energy at the positions now: closes the books of the sub-step that led here.
void BookElastic(double elastic_j, State* state);

// A change of positions by other means than velocities, from `before_m`; `elastic_j` is the elastic
// energy after it.
void BookCorrection(const Model& model, std::span<const Vec3> before_m, double elastic_j,
                    State* state);

// The projection that SubspaceSolver::Capture is about to make of the velocities:
// kicked_velocity_m_s().
void BookCapture(const Model& model, const SubspaceSolver& solver, State* state,
                 std::span<Wrench> tool_impulse);

// A body that falls asleep, before its velocities are zero: the ground captures it.
void BookSleep(const Model& model, const Body& body, State* state);

// The solver's last trial, before it is accepted. Adds the impulse of the tissue on each tool,
// about its tip at the start: N s, N m s.
void BookStep(const Model& model, const ForcesByKind& forces, std::span<const Vec3> total_force_n,
              const SubspaceSolver& solver, std::span<const Twist> tool_twist, double dt_s,
              State* state, std::span<Wrench> tool_impulse);

}  // namespace adhesim
