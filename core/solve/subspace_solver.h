#pragma once

#include <span>
#include <vector>

#include "core/model/effect.h"
#include "core/model/frame.h"
#include "core/model/state.h"
#include "core/solve/contact_rows.h"
#include "core/solve/rigid_group.h"
#include "core/solve/tie_rows.h"

namespace adhesim {

// The explicit step inside the subspace that zones leave (physics notes 3.4), with constraints of
// the step (2.2, 2.4).
//
// A trial does not touch the state: v* = v + dt f / m, projected onto every zone's rigid motions;
// then one impulse lambda along the gradient at x_n of every constraint row, all rows together,
// sized so that the row holds at x_{n+1} (SHAKE), in the zones' reduced coordinates; then x_{n+1}.
// Contacts that slide come between: their impulses and the constraints' are found in turns. Ties
// are rows beside the constraints', in one system with them. What a zone has to carry is the
// residual of each member.
class SubspaceSolver {
 public:
  // `constraints`: the effects that have rows; must outlive the solver.
  SubspaceSolver(const Model& model, std::vector<const Effect*> constraints);

  // Projects the velocities onto what zones that have just changed, and the constraints, permit: a
  // perfectly plastic impact. Books it in the ledgers.
  // Adds to each tool [#tools] the impulse of the tissue on it, about its tip.
  void Capture(State* state, std::span<Wrench> tool_impulse);

  // How exactly constraints are met, relative to their scale; kConstraintTolerance unless set.
  static constexpr double kConstraintTolerance = 1e-13;  // round-off of a volume is 1e-15
  void SetConstraintTolerance(double tolerance) { constraint_tolerance_ = tolerance; }

  // Forms the zones' groups: before a trial; `tool_twist` [#tools] about the tips.
  void FormGroups(const State& state, std::span<const Twist> tool_twist);
  // What tools do in the coming sub-step, for contacts that slide on them; spans must stay.
  void SetTools(const ContactRows::Tools& tools) { tools_ = tools; }
  // Tries a sub-step of `dt_s` under `force_n` [#particles]. `multipliers` [#rows], N s: where
  // those of the constraints begin; empty: at zero. `slides_met`: sliding() has its impulses.
  void Try(const State& state, std::span<const Vec3> force_n, double dt_s, Parallel* parallel,
           StepReport* report, std::span<const double> multipliers = {}, bool slides_met = false);
  // For what meets the contacts that slide before a trial.
  SlidingContacts sliding() { return {&slides_, tools_}; }
  // N, [#particles]: the force that its zone has to carry on each member, over the whole sub-step,
  // rotation included.
  std::span<const Vec3> load_n() const { return load_n_; }
  // Makes the last trial the state: positions, velocities, zones' momenta. load_n() is from then on
  // what sticking and sliding contact together carry.
  void Accept(State* state, double dt_s);

  // To be called when positions have changed otherwise.
  void Forget() {
    gradients_known_ = false;
    rows_off_ = rows_ > 0;
  }
  // What sleeps has changed: from now on what `state` says is left where it is.
  void LeaveOut(const State& state);

  // Meets the constraints by moving free particles, without touching velocities.
  void CorrectPositions(std::span<Vec3> position_m);

  // True where a row may lack more than steps leave: a body that starts flat has no volume.
  bool rows_off() const { return rows_off_; }
  bool has_rows() const { return rows_ > 0; }
  // Finds what they lack at the state's positions; false: nothing. What they do, the next steps
  // neither lose nor bring back: to meet it at once would take a speed of all of it over dt.
  bool RowsLack(const State& state);
  // Moves positions by a part of what was found lacking, no particle by more than `most_m`, and no
  // velocity with them. Members of zones stay.
  void RegainRows(double most_m, State* state);

  // What the ledgers need of the last trial.
  std::span<const Vec3> kicked_velocity_m_s() const {
    return kicked_m_s_;
  }                                                               // at x_n, before zones rotate
  std::span<const RigidGroup> groups() const { return groups_; }  // [#zones]
  std::span<const Vec3> moved_position_m() const { return moved_m_; }
  std::span<const Vec3> moved_velocity_m_s() const { return moved_velocity_m_s_; }
  // Impulse of the constraints on a particle, N s.
  Vec3 ConstraintImpulse(int p) const {
    return row_of_.empty() || row_of_[p] < 0 ? Vec3::Zero()
                                             : Vec3(multiplier_[row_of_[p]] * gradient_[p]);
  }
  // Of the sliding contacts.
  Vec3 SlidingImpulse(int p) const { return slides_.ImpulseOn(p); }
  // The particles that ties act on, ascending.
  std::span<const std::int32_t> tied() const { return ties_.particles(); }
  double TieGivingLoss() const { return ties_.GivingLoss(); }
  // Of the ties.
  Vec3 TieImpulse(int p) const { return ties_.ImpulseOn(p); }
  // Of all of them.
  Vec3 InnerImpulse(int p) const {
    return ConstraintImpulse(p) + SlidingImpulse(p) + TieImpulse(p);
  }
  // What ties carry in the last trial, in the order of bonds.
  std::span<const TieLoad> tie_load() const { return tie_load_; }
  const ContactRows& slides() const { return slides_; }
  // What became of the sliding contacts in the sub-step that was accepted last.
  std::span<const ContactRows::Verdict> slid() const { return slid_; }

 private:
  // The part of one constraint row that acts on one zone: a generalised gradient about the zone's
  // pivot.
  struct RowOnZone {
    std::int32_t row, zone;
    Vec3 force, moment;
  };
  // Consecutive particles on which the same row acts, or none (-1).
  struct Part {
    std::int32_t first, count, row;
    std::int32_t body;  // where bodies may sleep, of all of them
  };
  void MakeParts();
  void StoreMomenta(State* state, bool sleepers) const;
  void ProjectGroups(const State& state);
  void KickAll(const State& state);
  // Of all rows at these positions; what sleeps (`asleep`, or empty) is left as it was.
  void FindGradients(std::span<const Vec3> position_m, std::span<const std::uint8_t> asleep);
  void FindResiduals(std::span<const Vec3> position_m, std::span<const std::uint8_t> asleep,
                     std::span<double> residual) const;
  void CollectRows(const State& state);
  bool Sleeps(const State& state, int row) const {
    return state.sleep.Of(model_.body_of[row_[row].first]);
  }
  void StopConstraints(const State& state);
  void MeetSlides(const State& state);
  void GiveSlides(const State& state);
  double SlidingWork(const State& state) const;
  void ApplyAll(const State& state, std::span<const double> x, std::span<double> y);
  void SolveAll(const State& state, std::span<const double> rhs, double least_sq,
                std::span<double> x, StepReport* report);
  void StartTies(const State& state);
  void AddTies(const State& state);
  void MeetAll(const State& state, StepReport* report);
  void MeetConstraints(const State& state, double dt_s, Parallel* parallel, StepReport* report);
  double MeasureRows(const State& state, double dt_s);
  void MoveAll(const State& state, double dt_s, Parallel* parallel);
  void FinishMove(const State& state);
  void ShareLoads(const Contacts& contacts);
  void Extrapolate(int iteration);
  void SolveRows(std::span<const double> rhs, std::span<double> x);
  void ApplyRows(std::span<const double> x, std::span<double> y) const;
  void AddMultipliers(std::span<const double> change);
  static std::span<const std::int32_t> Members(const Contacts& contacts, const Zone& zone) {
    return {contacts.zone_members.data() + zone.first, static_cast<std::size_t>(zone.count)};
  }
  static std::span<const std::int32_t> Members(const Contacts& contacts, int zone) {
    return Members(contacts, contacts.zones[zone]);
  }

  const Model& model_;
  std::vector<const Effect*> constraints_;
  int rows_ = 0;
  double constraint_tolerance_ = kConstraintTolerance;
  // Scratch, sized at construction.
  std::vector<Vec3> kicked_m_s_, moved_m_, moved_velocity_m_s_, load_n_, free_m_s_;  // [#particles]
  std::vector<Vec3> per_kg_;  // [#particles] 1 / mass, three times; 0 where fixed or carried
  std::vector<double>
      carried_area_m2_;      // [#particles] of what it carries; empty: nothing is carried
  std::vector<Part> parts_;  // all particles
  int part_grain_ = 1;       // parts that are worth a thread
  std::vector<RigidGroup> groups_;
  ContactRows slides_;
  std::span<const ContactRows::Verdict> slid_;
  ContactRows::Tools tools_;
  TieRows ties_;
  std::span<const TieLoad> tie_load_;
  std::vector<Vec3> tie_scratch_ns_;  // [#particles]
  std::vector<Wrench> zone_wrench_;   // [#zones]
  std::vector<double> all_rhs_;       // [#rows, ties' rows]
  std::vector<Twist> old_twist_;      // [#tools]
  std::vector<std::int32_t>
      row_of_;  // [#particles] the row that acts on it, or -1; empty without rows
  std::vector<ConstraintRow> row_;  // [#rows]
  std::vector<Vec3> gradient_;      // [#particles]
  bool gradients_known_ = false;    // of the state's positions
  bool rows_off_ = false;
  double stuck_error_ = 0;              // relative, of the worst row that nothing can change
  std::vector<double> lacking_;         // [#rows] what they lack at the state's positions, or 0
  std::vector<Vec3> response_;          // [#particles] of a free particle: gradient over mass
  std::vector<double> multiplier_;      // [#rows] impulse along the gradient
  std::vector<double> best_;            // [#rows] of the iteration that left the least error
  std::vector<double> diagonal_;        // [#rows] of free particles; 0: nothing can move
  std::vector<double> movable_;         // [#rows] the same with those in zones as if they were free
  std::vector<double> preconditioner_;  // [#rows]
  std::vector<RowOnZone> on_zone_;
  std::vector<Twist> zone_response_;                         // [#zones]
  std::vector<double> residual_, left_;                      // [#rows]
  std::vector<double> change_, cg_r_, cg_p_, cg_ap_, cg_z_;  // [#rows, ties' rows]
};

}  // namespace adhesim
