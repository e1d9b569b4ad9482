#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "core/model/effect.h"
#include "core/model/frame.h"
#include "core/model/state.h"
#include "core/solve/arcs.h"
#include "core/solve/contact_rows.h"
#include "core/solve/implicit_rows.h"
#include "core/solve/rigid_group.h"
#include "core/solve/subspace_system.h"

namespace adhesim {

// Backward Euler in the subspace that zones leave (physics notes 3.5), for the effects that know
// their stiffness; the others stay explicit.
//
// Linearly implicit: one linear system for dv = v_{n+1} - v_n,
//   A dv = dt (f(x_n, v_n) - dt K (v_n - c - w x r)),  A = M + dt D + dt^2 K,
// c the way from tangents to arcs of bodies that turn (Arcs), w x r their turning where it is most
// of their motion.
// Newton: M dv = dt f(x_n + dt v_{n+1}, v_{n+1}), with A of the last iterate and a line search. A
// linear step that moves tissue far against itself, and gains energy, is made again so.
//
// The result is handed on as forces: those which, applied explicitly, lead to the same velocities.
// So projection, loads, release, wrenches and ledgers need not know how a step was made. On free
// particles and free zones what the solver left open is part of the elastic force (momentum errs by
// its sum); on members that something holds the force is f - K dt v_{n+1} - D dv itself, so that
// what tools and pins carry is the residual of the equation there.
//
// Constraint rows are met within the solve (implicit_rows.h). Their impulses are no part of the
// forces handed on: row_multipliers() go with them. So it is with contacts that slide
// (ContactRows::MeetWithin), whose rows keep their impulses themselves.
//
// Allocates at construction only.
class ImplicitSolver {
 public:
  struct StiffEffect {
    Effect* effect;
    int state_first;  // its part of State::effect_state
  };
  // Forces of a sub-step [#particles], by kind (empty: none of that kind) and together. Without the
  // damping of stiff effects when they come in; effective when they go out.
  struct Forces {
    std::array<std::span<Vec3>, kForceKinds> by_kind;
    std::span<Vec3> total;
  };

  // The effects outlive the solver. `constraints`: those whose rows it meets, all or none.
  ImplicitSolver(const Model& model, std::vector<StiffEffect> effects,
                 std::vector<const Effect*> constraints = {});
  ImplicitSolver(const ImplicitSolver&) = delete;
  ImplicitSolver& operator=(const ImplicitSolver&) = delete;

  // How much work a step is worth.
  struct Effort {
    double tolerance;
    int newton_iterations;    // at most, of a step by Newton's method
    int stiffness_every = 1;  // sub-steps from one assembly of A to the next; Newton: 1
  };
  Effort FullEffort() const { return {model_.tolerance, 50, 1}; }
  void SetEffort(const Effort& effort) { effort_ = effort; }
  // What is kept from earlier sub-steps is not of the state to come.
  void Forget() { assembled_dt_s_ = 0; }

  // How fast a body turns as a whole by these velocities, rad/s: see Arcs.
  double FastestTurn(const State& state, std::span<const Vec3> velocity_m_s) const {
    return arcs_.FastestTurn(state, velocity_m_s);
  }
  // Once a sub-step: keeps the forces and makes A at the state's positions.
  void Begin(const State& state, std::span<const NearPair> near, const Forces& forces, double dt_s,
             Parallel* parallel);
  // Collects and meets the contacts that slide. Once for every set of zones tried in it; `groups`
  // are the zones', driven ones with the twist to come. Replaces the forces by effective ones and
  // keeps the change of velocity in the state.
  void Solve(std::span<const RigidGroup> groups, double dt_s, State* state, const Forces& forces,
             Parallel* parallel, StepReport* report, const SlidingContacts& slides = {});

  // Makes these zones those of system(), and `residual` [#particles] what the linear equation lacks
  // at the velocities before the step, at those of the groups where tools hold: N s, in the rows of
  // all particles that can move.
  void StartResidual(std::span<const RigidGroup> groups, double dt_s, const State& state,
                     Parallel* parallel, std::span<Padded> residual);
  // Velocities and zones' motions at this change from there, or from where a solve started. Valid
  // until the next call.
  ContactRows::Motion MotionAt(std::span<const Padded> change_m_s,
                               std::span<const RigidGroup> groups, const State& state);
  double tolerance() const { return effort_.tolerance; }
  // What may be left of a residual of this size, in the preconditioner's norm.
  double Target(double residual) const {
    return std::max(effort_.tolerance * residual, round_off_);
  }

  // The forces as they came, for another Begin() with a shorter step.
  void GiveBack(const Forces& forces) const;

  // Of the last Solve(): what it left open in every row [#particles], N s, and the square of its
  // norm in the preconditioner's metric.
  std::span<const Padded> residual_ns() const { return residual_ns_; }
  double residual_sq() const { return residual_sq_; }
  int iterations() const { return iterations_; }
  // Of the last Solve(), empty without rows: N s along the gradients at x_n.
  std::span<const double> row_multipliers() const { return rows_.multipliers(); }
  ImplicitRows& rows() { return rows_; }
  // A and the subspace of the last Solve().
  SubspaceSystem& system() { return system_; }

 private:
  static BlockMatrix MatrixOf(const Model& model, const std::vector<StiffEffect>& effects);
  bool MovesFarWithin(double dt_s) const;
  bool GainsEnergy(const ForceInput& start, double dt_s);
  void StartNewton(const ForceInput& in);
  void Assemble(const ForceInput& in, double dt_s);
  ForceInput InputOf(const StiffEffect& stiff, const ForceInput& all) const;
  double EvaluateStiff(const ForceInput& all);
  void SetScale(const State& state, double dt_s);
  void Prescribe(const State& state, std::span<const RigidGroup> groups);
  void FindTurning(const State& state);
  Vec3 Asked(int p, double dt_s, const State& state) const;
  void LinearResidual(double dt_s, const State& state, Parallel* parallel);
  void SolveLinear(std::span<const RigidGroup> groups, double dt_s, const State& state,
                   Parallel* parallel, StepReport* report);
  void BalanceLinear(double dt_s, const State& state, Parallel* parallel);
  void StartFromLastChange(std::span<const RigidGroup> groups, const State& state,
                           Parallel* parallel);
  void SolveNewton(std::span<const RigidGroup> groups, double dt_s, const State& state,
                   Parallel* parallel, StepReport* report);
  // Of rows: each iteration leaves the part by which gradients change in the step. What is left in
  // the end is met on inertia alone.
  static constexpr int kRowIterations = 12;
  static constexpr double kRowTolerance = 1e-12;
  static constexpr int kSlideTurns = 3;  // of contacts that slide with volumes, or Newton's forces
  double MeasureRows(double dt_s, const State& state);
  void MeetRows(double dt_s, const State& state, Parallel* parallel, StepReport* report);
  void NewtonWithRows(std::span<const RigidGroup> groups, double dt_s, const State& state,
                      Parallel* parallel, StepReport* report);
  bool CollectSlides(std::span<const RigidGroup> groups, double dt_s, const State& state);
  void MeetSlides(std::span<const RigidGroup> groups, double target, const State& state,
                  Parallel* parallel, StepReport* report);
  // N s, of all that is met within the solve.
  Vec3 InnerImpulse(int p) const {
    return slides_.rows ? Vec3(rows_.ImpulseOn(p) + slides_.rows->ImpulseOn(p))
                        : rows_.ImpulseOn(p);
  }
  void IterateNewton(std::span<const RigidGroup> groups, double dt_s, const State& state,
                     Parallel* parallel, StepReport* report);
  double Slope(std::span<const Padded> direction) const;
  void SearchAlong(std::span<const Padded> direction, double dt_s, const State& state,
                   Parallel* parallel);
  double NewtonResidual(double dt_s, const State& state, Parallel* parallel);
  void EffectiveForces(std::span<const RigidGroup> groups, double dt_s, const State& state,
                       const Forces& forces, Parallel* parallel);
  void MatchFreeZones(std::span<const RigidGroup> groups, double dt_s, const State& state,
                      std::span<Vec3> force_n) const;

  const Model& model_;
  std::vector<StiffEffect> effects_;
  Effort effort_ = FullEffort();
  double assembled_dt_s_ = 0;  // of A; 0: there is none
  int assembled_ago_ = 0;      // sub-steps
  BlockMatrix matrix_;
  SubspaceSystem system_;
  ImplicitRows rows_;
  SlidingContacts slides_;                    // of the solve that is being made
  std::vector<RigidGroup> groups_at_change_;  // [#zones] at the velocities found so far
  std::vector<std::int32_t> diagonal_;        // [#particles] slots
  bool by_newton_ = false;                    // this sub-step
  double nearest_m_ = 0;                      // two particles that act on each other, at rest
  bool damps_ = false;                        // some stiff effect has damping
  std::span<const NearPair> near_;
  double scale_ = 0, round_off_ = 0;  // in the preconditioner's norm, N s scaled
  double residual_sq_ = 0;
  int iterations_ = 0;
  // Forces as they came [#particles].
  std::vector<Vec3> start_elastic_n_, start_damping_n_, start_total_n_;
  std::vector<Vec3> explicit_n_;                 // Newton: total without the stiff effects' elastic
  std::vector<Vec3> elastic_n_, damping_n_;      // of stiff effects, evaluated anew
  std::vector<Vec3> position_m_, velocity_m_s_;  // where they were
  std::vector<double> effect_state_;
  Arcs arcs_;
  std::vector<Vec3> arc_m_s_;     // linear steps: c, see Arcs; 0 where zones turn by themselves
  std::vector<Vec3> turning_ns_;  // linear steps: see FindTurning()
  // Where the search starts: v_n, in linear steps on the tangent at x_n, so that what just turns
  // has no strain in it. What is held: its velocity to come.
  std::vector<Padded> prescribed_m_s_;
  std::vector<Padded> change_m_s_;  // the unknown: v_{n+1} - c - prescribed_m_s_
  std::vector<Padded> residual_ns_, direction_, product_;
  std::vector<Padded> newton_, last_residual_ns_;  // Newton only
  std::vector<Vec3> damped_m_s_;                   // Newton, with damping only
  std::vector<Padded> without_rows_m_s_;           // Newton with rows only
};

}  // namespace adhesim
