#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/block_matrix.h"
#include "core/model/disjoint_sets.h"
#include "core/model/model.h"
#include "core/model/parallel.h"
#include "core/model/state.h"
#include "core/solve/rigid_group.h"
#include "core/solve/row_system.h"

namespace adhesim {

// S^T A S y = S^T b by conjugate gradients (Baraff and Witkin 1998, in the form of a projected
// preconditioner). S are the velocities that zones leave: three numbers of each free particle, the
// twist of each zone as far as its freedom goes, nothing of fixed particles, of those that tools
// hold, and of carried ones.
//
// Vectors are [#particles]. Directions lie in range(S): members of a zone move as one. Residuals
// are those of all rows; what counts of them is S^T r. The preconditioner
//   P^-1 = S blockdiag(A_ii^-1 of free particles, (S_z^T A S_z)^-1 of zones) S^T
// takes the one into the other, so that plain conjugate gradients on these vectors are conjugate
// gradients in the subspace.
//
// Dot products are summed in chunks of particles, then over the chunks in order: the same bits for
// any number of threads and any instruction set. Allocates at construction only.
class SubspaceSystem : public RowSystem {
 public:
  // Both outlive the system. `matrix` is A once the caller has assembled it.
  SubspaceSystem(const Model& model, const BlockMatrix& matrix);

  // Inverts the diagonal blocks: after every assembly.
  void InvertDiagonal(Parallel* parallel);
  // The subspace that these zones leave.
  void SetZones(const State& state, std::span<const RigidGroup> groups);

  // True: a free particle, or a member of a zone that nobody prescribes.
  bool active(int p) const { return active_[p]; }
  // S_z^T A S_z of a zone's members that can move, whoever moves them, as twists about a pivot.
  Mat6 BlockOf(const State& state, int zone, const Vec3& pivot_m) const;
  // y = A x in the active rows, 0 in the others; returns x.y.
  double Multiply(std::span<const Padded> x, std::span<Padded> y,
                  Parallel* parallel) const override;
  // One row of A x, active or not.
  Vec3 MultiplyRow(int row, std::span<const Padded> x) const;
  // z = P^-1 r; returns r.z, the square of the norm that tolerances are measured in. The one place
  // for another preconditioner: it must be symmetric, positive definite on the subspace, and give
  // vectors of it.
  double Precondition(std::span<const Padded> r, std::span<Padded> z,
                      Parallel* parallel) const override;
  void Push(int particle, const Vec3& impulse_ns, std::span<Padded> r) const override {
    if (active_[particle]) r[particle].Set(r[particle].vec() + impulse_ns);
  }
  // Tools are prescribed.
  void PushTool(int, const Vec3&, const Vec3&, std::span<Padded>) const override {}
  Vec3 ToolVelocity(int, const Vec3&, std::span<const Padded>) const override {
    return Vec3::Zero();
  }
  // The projection of any velocities onto the subspace, in the metric of the masses.
  void Project(const State& state, std::span<const RigidGroup> groups,
               std::span<Padded> velocity) const;
  // Moves what is loose as a whole, each group of bodies that zones join by itself, so that r sums
  // to zero there: x += Z (Z^T A Z)^-1 Z^T r, Z its translations. Whatever tolerance the solve had,
  // momentum is then balanced to round-off; and in free fall this is the solution.
  void Balance(std::span<Padded> x, std::span<Padded> r) const;
  // The same, and what is left open does no work: no torque, to first order in the strain, about
  // what a component can turn about as a whole (its centre of mass, a point or an axis that is
  // held), and r.u = 0 for the velocities u of what is not free. Backward Euler of linear forces
  // changes the energy by
  //   -1/2 |dv|_M^2 - 1/2 dt^2 u.K u - r.u:
  // it only loses then, whatever tolerance the solve had, where a residual would else push stiff
  // bodies on or spin them up. u, and A u of what is active, are those at x and are not kept. Costs
  // a product where something turns.
  void BalanceWork(std::span<Padded> u, std::span<Padded> au, std::span<Padded> x,
                   std::span<Padded> r, Parallel* parallel);
  // y -= A x in the active rows, x of what is not active.
  void SubtractHeld(std::span<const Padded> x, std::span<Padded> y) const;
  // The sum of f.A_ii^-1 f over all particles, whether they can move or not.
  double DiagonalNormSq(std::span<const Vec3> f) const;
  const Mat3& inverse_diagonal(int p) const { return inverse_diagonal_[p]; }
  // What a zone's block answers to an impulse and its moment about the zone's pivot; nothing where
  // it is held.
  Twist Response(int zone, const Vec3& impulse, const Vec3& moment) const;

  struct Result {
    int iterations = 0;
    bool converged = true;
    double residual_sq = 0;  // r.P^-1 r of what is left
  };
  // Improves x until |r|_{P^-1} <= target; r is the residual of x, and is kept so.
  Result Solve(double target, int max_iterations, std::span<Padded> x, std::span<Padded> r,
               Parallel* parallel);

 private:
  struct Whole {  // a component
    Hold hold;
    double work = 0, curvature = 0;  // r.u and u.A u
    Vec3 residual = Vec3::Zero();    // sums of r and of A u over what is loose
    Vec3 product = Vec3::Zero();
    double part = 0;  // of u, to be added
    // Of what turns, about the centre of mass or what is held.
    Vec3 turn = Vec3::Zero();  // rad/s to be added; the torque of r before
    double mass_kg = 0;
    Vec3 origin_m = Vec3::Zero();
    Vec3 centre_m = Vec3::Zero();
    Mat3 spread = Mat3::Zero();  // sum of m r r^T
  };
  struct ZoneInverse {
    int zone;
    Vec3 pivot_m;
    Mat6 inverse;  // (S_z^T A S_z)^-1 on its possible twists (V, W), 0 on the others
  };
  Mat6 InverseOf(const RigidGroup& group, const State& state, int zone) const;
  void PreconditionZones(std::span<const Padded> r, std::span<Padded> z, double* chunk_sums) const;
  double SumChunks() const;
  void FindLoose(const State& state, std::span<const RigidGroup> groups);
  void FindHolds(std::span<const RigidGroup> groups);
  Whole& WholeOf(int p) { return wholes_[component_[model_.body_of[p]]]; }
  template <typename Visit>
  void ForEachTurning(const Visit& visit);
  void MeasureWork(std::span<const Padded> u, std::span<const Padded> au,
                   std::span<const Padded> r);
  bool MeasureTurns(std::span<const Padded> r);
  static void FindPart(const Mat3& stiffness_sum, Whole* whole);
  void AddTurns(std::span<Padded> u, std::span<Padded> au, std::span<Padded> x, std::span<Padded> r,
                Parallel* parallel);
  // x += alpha p, r -= alpha ap, z = P^-1 r of free particles; returns r.z with the zones'.
  double Advance(double alpha, std::span<Padded> x, std::span<Padded> r, Parallel* parallel);

  const Model& model_;
  const BlockMatrix& matrix_;
  std::vector<Mat3> inverse_diagonal_;       // [#particles], and room to read one more
  std::vector<std::uint8_t> active_, free_;  // [#particles]; free: active and in no zone
  // [#particles] a free particle, or a member of a zone without pins.
  std::vector<std::uint8_t> loose_;
  DisjointSets joined_;                  // of bodies
  std::vector<std::int32_t> component_;  // [#bodies] the lowest of the bodies joined with it
  std::vector<Mat3> stiffness_sum_;      // [#bodies] Z^T A Z of a component
  mutable std::vector<Vec3> balance_;    // [#bodies]
  std::vector<Whole> wholes_;            // [#bodies] of a component
  std::vector<ZoneInverse> zones_;
  std::span<const std::int32_t> members_;  // Contacts::zone_members and zones of the state given
  std::span<const Zone> contacts_zones_;
  std::span<const Vec3> position_m_;
  mutable std::vector<double> chunk_sum_;   // [#chunks]
  mutable std::vector<Padded> p_, ap_, z_;  // [#particles]
};

}  // namespace adhesim
