#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/model/carried.h"
#include "core/model/model.h"
#include "core/model/state.h"
#include "core/model/tie_geometry.h"
#include "core/solve/rigid_group.h"

namespace adhesim {

// The ties of a sub-step (zone mode T, physics notes 3.3, item 9) as rows, three a tie: what
// multipliers (impulses on the particle's side, N s) are as impulses on particles, and what
// velocities of particles are as speeds of ties. Ties may act on carried particles: impulses go to
// what carries them. The system itself is SubspaceSolver's, together with the other constraints.
//
// Ties that only keep surfaces apart repeat what others say, and not quite the same: they give way
// a little, so that all together have a solution.
//
// Drift: speeds are asked for that bring offsets back within the sub-step to what the bonds keep
// (SHAKE with one iteration; its error is the next sub-step's to mend).
class TieRows {
 public:
  explicit TieRows(const Model& model);

  // True when the scene can have ties.
  bool possible() const { return !impulse_ns_.empty(); }
  int capacity() const { return static_cast<int>(ties_.capacity()); }
  // Makes the rows of all tied bonds at the state's positions. `dt_s` 0: no drift is mended, and no
  // impulse taken from the last sub-step.
  void Collect(const State& state, std::span<const RigidGroup> groups, std::span<const Vec3> per_kg,
               double dt_s);
  bool empty() const { return ties_.empty(); }
  int rows() const { return 3 * static_cast<int>(ties_.size()); }
  // Whose velocities ties see or change, ascending.
  std::span<const std::int32_t> particles() const { return acted_; }

  // Impulses on particles() of multipliers [rows].
  void Scatter(std::span<const double> multiplier, std::span<Vec3> impulse_ns) const;
  // Speeds [rows] of velocities of particles(); writes those of carried ones.
  void Gather(std::span<Vec3> velocity_m_s, std::span<double> speed) const;
  // Adds to speeds what ties give way under multipliers.
  void AddGiving(std::span<const double> multiplier, std::span<double> speed) const;
  // What ties that give way take from an impact beside its own loss.
  double GivingLoss() const;
  // The speeds asked for, less these and what ties give way under their impulses so far.
  void Missing(std::span<const double> speed, std::span<double> missing) const;
  // z = the inverse of each tie's own block times r; returns r.z.
  double Precondition(std::span<const double> r, std::span<double> z) const;
  // Twice the energy of multipliers by the ties' own blocks, and that of speeds that are round-off.
  double BlockNorm(std::span<const double> multiplier) const;
  double round_off() const { return round_off_; }

  // The impulses so far: to begin with, those of the last sub-step.
  std::span<const double> start() const { return start_; }
  void Add(std::span<const double> multiplier, std::span<const Vec3> impulse_ns);
  Vec3 ImpulseOn(int particle) const {
    return ties_.empty() ? Vec3::Zero() : impulse_ns_[particle];
  }
  // Of each tied bond, in their order.
  std::span<const TieLoad> Loads(double dt_s);
  // Adds what ties carry on each particle [#particles], N, to those that no zone holds.
  void AddLoads(const State& state, double dt_s, std::span<Vec3> load_n) const;
  // Keeps the impulses for the next sub-step.
  void Store(double dt_s, Contacts* contacts) const;

 private:
  struct Tie {
    std::int32_t bond;
    TieGeometry geometry;
    Mat3 block, inverse;  // speed by unit impulses, 1/kg; inverse 0: nothing can move
    double gives;         // this part of its block
    Vec3 wanted_m_s;
    Vec3 impulse_ns;
  };
  Mat3 BlockOf(const TieGeometry& geometry, const State& state, std::span<const RigidGroup> groups,
               std::span<const Vec3> per_kg) const;
  Mat3 Mobility(int particle, const State& state, std::span<const RigidGroup> groups,
                std::span<const Vec3> per_kg) const;
  void Act(int particle);

  const Model& model_;
  CarriedLookup carried_;
  std::vector<Tie> ties_;
  std::vector<TieLoad> loads_;
  std::vector<double> start_;  // [rows]
  double round_off_ = 0;
  std::vector<std::int32_t> acted_;                    // particles()
  std::vector<const CarriedParticle*> acted_carried_;  // those of Model::carried among them
  std::vector<std::uint8_t> stamp_;                    // [#particles]
  std::vector<Vec3> impulse_ns_;                       // [#particles] in this sub-step
};

}  // namespace adhesim
