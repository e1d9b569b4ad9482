#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "core/model/bond_geometry.h"
#include "core/model/carried.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/state.h"
#include "core/solve/rigid_group.h"
#include "core/solve/subspace_system.h"

namespace adhesim {

// Contacts that slide: surfaces that may not come closer than half a capture distance, that the
// adhesive holds together up to its normal strength, and that rub on each other (Coulomb with
// adhesion: |J_t| <= mu J_n + sigma_t A dt). Impulses at the velocities of the sub-step, found by
// projected Gauss-Seidel in the order of the bonds (physics notes 3.6).
//
// On a tool (ToolAdhesion.friction_coefficient) they slide by the same rules; its motion is given,
// it takes the whole of an impulse and its moment, and what it does to tissue is its work.
//
// An impulse acts on the particles of both sides so that its sum and its moment vanish; what is
// carried hands its share on to its carriers, by their weights, which keeps both. Every row
// ends at, or moves towards, no sliding and no approach. An impulse J on speeds that go from v to
// v' does the work J (v + v') / 2, which is positive where forces have turned v round within the
// sub-step and the row would stop it at zero; there it is let go back as fast as it came, -v, for
// no work (the surfaces come as near as they were a sub-step ago and no nearer). So rows take
// energy, but for what sweeps that have not converged leave.
//
// Where tissue is implicit, the rows are met through its matrix instead (MeetWithin): an impulse on
// inertia alone would move stiff tissue far out of its balance. Forces act over dt v' there, and
// impulses do the work J v': nothing needs to be let go back.
class ContactRows {
 public:
  // Velocities that impulses change: of free particles [#particles], and of zones [#zones].
  struct Motion {
    std::span<Vec3> velocity_m_s;
    std::span<RigidGroup> groups;
  };
  // What tools do in a sub-step [#tools]: their twists about the tips, before and in it, and what
  // multiplies their strengths.
  struct Tools {
    std::span<const Twist> before, coming;
    std::span<const double> strength_scale;
  };
  // What became of a sliding contact in a sub-step.
  enum class Outcome : std::uint8_t { kApart, kSlides, kSticks, kParts };

  explicit ContactRows(const Model& model);

  // True when the scene can have such contacts.
  bool possible() const { return !impulse_ns_.empty(); }
  // Makes a row of every bond that slides; `motion` is what happens without them. `within`: they
  // are going to be met within an implicit step.
  void Collect(const State& state, const Motion& motion, const Tools& tools, double dt_s,
               bool within = false);
  bool within() const { return within_; }
  bool empty() const { return rows_.empty(); }
  // One pass over all rows.
  void Sweep(const State& state, const Motion& motion);

  // What rows are met within in an implicit step.
  struct Within {
    const RowSystem* system;
    const SubspaceSystem* tissue;  // its blocks of particles and zones
    // The unknown of its equation and what is left of it, rows' impulses so far included.
    std::span<Padded> change_m_s, residual_ns;
    double target, tolerance;  // what may be left: in the preconditioner's norm, relative
    int max_iterations;        // of one of its solves
    Parallel* parallel;
    StepReport* report;
  };
  // Finds the impulses through the system's matrix, from those that the rows have now, and changes
  // what is unknown with them; `motion` is at the unknown as it comes in. Gives the impulses to no
  // velocities: ImpulseOn() has them. Returns the iterations of all solves.
  int MeetWithin(const State& state, const Motion& motion, const Within& within);
  // What the tool's rows answer to its twist in a step, each with all around it held still; 0
  // without rows. Once they are collected.
  Mat6 Stiffness(int tool, const State& state, std::span<const RigidGroup> groups,
                 const SubspaceSystem& system) const;
  // Goes on from there, where what is left has changed since.
  int MeetFurther(const State& state, const Within& within);
  // Forgets the rows.
  void Clear();
  // The impulses found are where those of the same rows start when they are collected again.
  void KeepAsStart();
  void ForgetStart() {
    started_.clear();
    started_ended_sq_ = 0;
  }

  // The particles that rows move, ascending, and what they get in this sub-step, N s.
  std::span<const std::int32_t> particles() const { return acted_; }
  Vec3 ImpulseOn(int particle) const {
    return rows_.empty() ? Vec3::Zero() : impulse_ns_[particle];
  }
  // The carried particles among those that touch, and what came to their carriers by them.
  std::span<const std::int32_t> carried() const { return carried_touching_; }
  Vec3 ImpulseBy(int carried_particle) const { return carried_impulse_ns_[carried_particle]; }

  // Impulse and moment of tissue on a tool about its tip, and the tool's work on tissue.
  struct OnTool {
    std::int32_t tool;
    Vec3 point_m;     // where
    Vec3 impulse_ns;  // on the tissue
    double work_j;
    double end_work_j;  // with the tool's velocity in the sub-step alone
  };
  template <typename Visit>
  void ForEachOnTool(const Visit& visit) const {
    for (const Row& row : rows_) {
      if (row.tool < 0) continue;
      Vec3 impulse = Vec3::Zero();
      double work_j = 0, end_work_j = row.impulse.dot(row.tool_m_s);
      for (int k = 0; k < 3; ++k) {
        impulse += row.impulse(k) * row.direction[k];
        work_j += 0.5 * row.impulse(k) * (row.tool_before_m_s(k) + row.tool_m_s(k));
      }
      visit(OnTool{row.tool, row.point_m, impulse, work_j, end_work_j});
    }
  }

  // Of each sliding bond, in their order, at these velocities.
  struct Verdict {
    std::int32_t bond;
    Outcome outcome;
  };
  std::span<const Verdict> Judge(const State& state, const Motion& motion, double dt_s);

 private:
  static constexpr int kNodes = 4;
  struct Row {
    std::int32_t bond;
    std::int32_t tool;  // -1: two bodies
    std::array<std::int32_t, kNodes> particle;
    std::array<Vec3, 3> direction;   // normal and two tangents
    Vec3 point_m;                    // tools: where they touch
    Vec3 tool_before_m_s, tool_m_s;  // the tool's velocity there along the three, before and now
    double friction;                 // Coulomb's coefficient
    std::array<std::array<Vec3, kNodes>, 3> gradient;  // along the normal and two tangents
    std::array<double, 3> mobility;                    // 1/kg; normal, and the larger tangential
    Vec3 impulse = Vec3::Zero();                       // N s along the three
    // Where impulses drive to: apart no slower, together no slower (under tension), and along.
    double least_speed_m_s, most_speed_m_s;
    Eigen::Vector2d rub_speed_m_s;
    bool touches;                 // near enough for the adhesive
    double tension_ns, shear_ns;  // what the adhesive carries
  };
  Row MakeRow(int bond, const State& state, const Motion& motion, const Tools& tools,
              double dt_s) const;
  void LeaveNoMoment(const State& state, Row* row) const;
  // Rows between two bodies, and what the adhesive carries on the particles of either side.
  struct Interface {
    std::int32_t first, second;  // bodies, first < second
    std::array<BondLimit, 2> limit;
  };
  Interface& InterfaceOf(const Bond& bond);
  void Act(int particle);
  // What moves by itself of a row's particles, each once, and the row's gradient there.
  struct Node {
    std::int32_t particle;
    Vec3 gradient;
  };
  std::span<const Node> NodesOfRow(const Row& row, int direction,
                                   std::array<Node, 4 * kNodes>* nodes) const;
  void ShareLimits(const State& state, const Tools& tools, double dt_s);
  void ShareToolLimits(const State& state, const Tools& tools, double dt_s);
  BondGeometry Predict(const Bond& bond, const BondGeometry& now, const State& state, double dt_s,
                       Vec3* weights) const;
  Vec3 Velocity(int particle, const State& state, const Motion& motion) const;
  // 1/kg. Of inertia; with a system: of its diagonal blocks.
  double Mobility(const Row& row, int direction, const State& state,
                  std::span<const RigidGroup> groups, const SubspaceSystem* system = nullptr) const;
  double Speed(const Row& row, int direction, const State& state, const Motion& motion) const;
  // `motion`: what it moves; null: nothing, it is only booked.
  void Apply(const Row& row, int direction, double impulse, const State& state,
             const Motion* motion);

  // A row in an implicit step, along the normal and the tangents: a multiplier, and a spring beside
  // it for what the multiplier misses.
  struct Law {
    Vec3 speed_m_s, multiplier_ns, impulse_ns;
    double limit_ns;                // of friction
    std::array<double, 2> most_kg;  // the springs' impulse a speed, along the normal and tangents
    Vec3 weight_kg;           // likewise as the solve has them, softer or 0 beyond their limits
    Vec3 along_m_s, way_m_s;  // what a search direction, and all of them, do to the speed
  };
  void StartLaw(const Row& row, const State& state, const Motion& motion, const Within& within,
                Law* law) const;
  // N s along the surface; the adhesive acts across what is near enough to be captured.
  static double FrictionLimit(const Row& row, double normal_ns) {
    return row.touches || normal_ns > 0 ? row.friction * std::max(normal_ns, 0.0) + row.shear_ns
                                        : 0;
  }
  static Vec3 ImpulseOf(const Row& row, const Law& law, const Vec3& speed_m_s);
  static void Linearise(const Row& row, Law* law);
  void Renew(const Within& within);
  double Norm(const Within& within);
  double ImpulseNorm() const;
  double MissedSq() const;
  double LimitsMissed() const;
  int SolveLaws(const Within& within);
  void SearchAlong(const Within& within);
  double Multiply(const Within& within);
  Vec3 Moved(int particle) const;
  void AddTo(std::span<Padded> to, const Row& row, const Vec3& impulse,
             const RowSystem& system) const;
  void StartAsKept(const State& state);

  const Model& model_;
  std::vector<Row> rows_;
  bool within_ = false;  // they are met within an implicit step
  // Of MeetWithin().
  std::vector<Law> laws_;  // [#rows]
  double ended_sq_ = 0;  // speeds that they end, (m/s)^2: the most missed since they were collected
  std::vector<Padded> direction_, product_, step_, way_m_s_, left_ns_;  // [#particles, tools' two]
  struct Started {
    std::array<std::int32_t, kNodes> particle;
    std::int32_t tool;
    Vec3 impulse;
  };
  std::vector<Started> started_;  // [#rows] of KeepAsStart()
  double started_ended_sq_ = 0;
  std::vector<Verdict> verdicts_;
  std::vector<Interface> interfaces_;  // ascending
  CarriedLookup carried_;
  std::vector<std::int32_t> carried_touching_;
  std::vector<Vec3> carried_impulse_ns_;  // [#particles]; empty: nothing is carried
  std::vector<Vec3> impulse_ns_;          // [#particles]
  std::vector<double> touch_;             // [#particles] sum of weights in one tool's rows
  std::vector<std::int32_t> acted_;
  std::vector<std::uint8_t> stamp_;  // [#particles] in acted_ already
};

// The rows that an implicit step meets; none: null.
struct SlidingContacts {
  ContactRows* rows = nullptr;
  ContactRows::Tools tools;
};

}  // namespace adhesim
