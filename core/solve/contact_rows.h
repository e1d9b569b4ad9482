#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/model/model.h"
#include "core/model/state.h"
#include "core/solve/rigid_group.h"

namespace adhesim {

// Contacts that slide: surfaces that may not come closer than half a capture distance, that the
// adhesive holds together up to its normal strength, and that rub on each other (Coulomb with
// adhesion: |J_t| <= mu J_n + sigma_t A dt). Impulses at the velocities of the sub-step, found by
// projected Gauss-Seidel in the order of the bonds (physics notes 3.6).
//
// An impulse acts on the particles of both sides so that its sum and its moment vanish. It only
// ever takes energy: every row ends at, or moves towards, no sliding and no approach.
class ContactRows {
 public:
  // Velocities that impulses change: of free particles [#particles], and of zones [#zones].
  struct Motion {
    std::span<Vec3> velocity_m_s;
    std::span<RigidGroup> groups;
  };
  // What became of a sliding contact in a sub-step.
  enum class Outcome : std::uint8_t { kApart, kSlides, kSticks, kParts };

  explicit ContactRows(const Model& model);

  // Makes a row of every bond that slides.
  void Collect(const State& state, std::span<const RigidGroup> groups, double dt_s);
  bool empty() const { return rows_.empty(); }
  // One pass over all rows.
  void Sweep(const State& state, const Motion& motion);
  // The particles that rows act on, ascending, and what they get in this sub-step, N s.
  std::span<const std::int32_t> particles() const { return acted_; }
  Vec3 ImpulseOn(int particle) const {
    return rows_.empty() ? Vec3::Zero() : impulse_ns_[particle];
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
    std::array<std::int32_t, kNodes> particle;
    std::array<std::array<Vec3, kNodes>, 3> gradient;  // along the normal and two tangents
    std::array<double, 3> mobility;                    // 1/kg; normal, and the larger tangential
    Vec3 impulse = Vec3::Zero();                       // N s along the three
    double approach_m_s;                               // of what is still apart; <= 0
    double tension_ns, shear_ns;                       // what the adhesive carries
  };
  Row MakeRow(int bond, const State& state, std::span<const RigidGroup> groups, double dt_s) const;
  double Mobility(const Row& row, int direction, const State& state,
                  std::span<const RigidGroup> groups) const;
  double Speed(const Row& row, int direction, const State& state, const Motion& motion) const;
  void Apply(const Row& row, int direction, double impulse, const State& state,
             const Motion& motion);

  const Model& model_;
  std::vector<Row> rows_;
  std::vector<Verdict> verdicts_;
  std::vector<Vec3> impulse_ns_;  // [#particles]
  std::vector<std::int32_t> acted_;
  std::vector<std::uint8_t> stamp_;  // [#particles] in acted_ already
};

}  // namespace adhesim
