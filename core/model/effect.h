#pragma once

#include <span>
#include <string_view>

#include "core/model/block_matrix.h"
#include "core/model/model.h"
#include "core/model/near_pair.h"
#include "core/model/parallel.h"
#include "core/model/state.h"

namespace adhesim {

// Kinds of force, apart because the energy and momentum ledgers book them apart.
enum ForceKind : unsigned {
  kElastic = 1u << 0,  // minus the gradient of an energy; sums to zero force and torque
  kDamping = 1u << 1,  // internal friction; sums to zero force and torque, takes energy
  kField = 1u << 2,    // from outside; its work is external work
  kDrag = 1u << 3,     // from outside, against velocity; takes energy
};
inline constexpr int kForceKinds = 4;

// What forces depend on. Particle arrays are [#particles].
struct ForceInput {
  std::span<const Vec3> position_m;
  std::span<const Vec3> velocity_m_s;
  double time_s;
  std::span<double> effect_state;  // this effect's own part of State::effect_state
  Parallel* parallel;
  // Particles within contact_reach_m() (or further) of other bodies, ascending by (particle, body);
  // of the beginning of the sub-step.
  std::span<const NearPair> near = {};
  // An evaluation beside the step's own, such as of positions that an iteration tries: what
  // remembers the past must not change.
  bool trial = false;
  // [#bodies] those that are left out; empty: none.
  std::span<const std::uint8_t> asleep = {};
  bool Sleeps(int body) const { return !asleep.empty() && asleep[body]; }
};

// Where forces go: N, [#particles], already zero before the first effect adds to them. Only the
// arrays of the kinds that an effect declares may be touched.
struct ForceOutput {
  std::span<Vec3> elastic;
  std::span<Vec3> damping;
  std::span<Vec3> field;
  std::span<Vec3> drag;
};

// A constraint row: a function of the particles [first, first + count), kept at zero. Rows of a
// scene do not overlap.
struct ConstraintRow {
  int first = 0;
  int count = 0;
  double scale = 1;  // a residual of this size is a relative error of 1
};

// Something that acts on bodies. Made once from its message; const afterwards: what evolves is in
// State.
//
// An author overrides either the force part or the constraint part; masses, integration, zones,
// ledgers, snapshots and threads are the engine's.
class Effect {
 public:
  virtual ~Effect() = default;
  // The name of its field in the scene's Effect message.
  virtual std::string_view name() const = 0;

  // True: it acts within bodies only, not by the time, and leaves out those that sleep
  // (ForceInput::asleep): no force, no energy, no constraint of theirs. In a scene with an effect
  // that has_stiffness() all bodies that can move sleep, or none.
  virtual bool lets_sleep() const { return false; }

  // --- Forces.
  // ForceKind bits that AddForces writes.
  virtual unsigned force_kinds() const { return 0; }
  // Adds its forces and returns its elastic energy, J. Allocates nothing.
  virtual double AddForces(const ForceInput& in, const ForceOutput& out) const { return 0; }
  // Adds to each particle [#particles] its share of the elastic energy of the last AddForces(), J;
  // the shares sum to what that returned.
  virtual void AddEnergies(std::span<double> energy_j) const {}
  // Adds to each particle an upper bound of the row sums of its stiffness [N/m] and damping [N
  // s/m]: the explicit stability bound comes from them.
  virtual void AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const {}
  // --- Stiffness, for implicit steps. An effect without it is explicit in them. Of one that has
  // it, damping forces are linear in velocity: -D v with the D below.
  virtual bool has_stiffness() const { return false; }
  // Names every pair of particles whose forces depend on each other.
  virtual void AddPairs(BlockMatrix::Pattern* pattern) const {}
  // Called once, with the matrix made from all effects' patterns: the place to look up slots.
  virtual void UseMatrix(const BlockMatrix& matrix) {}
  // Adds stiffness_scale * K + damping_scale * D at the positions and velocities of `in`, where K =
  // -d(elastic force)/dx and D = -d(damping force)/dv, both made symmetric and positive
  // semidefinite. The rows of each sum to zero. Allocates nothing.
  virtual void AddStiffness(const ForceInput& in, double stiffness_scale, double damping_scale,
                            BlockMatrix* matrix) const {}
  // Distance within which it wants to know the pairs of ForceInput::near; 0: none.
  virtual double contact_reach_m() const { return 0; }
  // Numbers of State::effect_state that it keeps, and their values at the start.
  virtual int state_size() const { return 0; }
  virtual void InitialState(std::span<double> state) const {}

  // --- Strength of adhesion.
  // True: ScaleStrengths() is called in every sub-step once contacts are known.
  virtual bool scales_strengths() const { return false; }
  // Multiplies each Bond::strength_scale, which is 1 before the first effect, by a factor >= 0, and
  // changes nothing else. `time_s` is that of the step's beginning, as in Bond::since_s.
  virtual void ScaleStrengths(double time_s, std::span<Bond> bonds) const {}

  // --- Constraints.
  virtual std::span<const ConstraintRow> constraints() const { return {}; }
  // One residual a row. `asleep` as in ForceInput: their rows are left as they are.
  virtual void ConstraintResiduals(std::span<const Vec3> position_m,
                                   std::span<const std::uint8_t> asleep,
                                   std::span<double> residual) const {}
  // The rows' gradients, each written into its particles of [#particles].
  virtual void ConstraintGradients(std::span<const Vec3> position_m,
                                   std::span<const std::uint8_t> asleep,
                                   std::span<Vec3> gradient) const {}
};

}  // namespace adhesim
