#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/model.h"
#include "core/model/parallel.h"
#include "core/model/state.h"
#include "core/solve/implicit_solver.h"

namespace adhesim {

// What the implicit solver left open in the force on each tool, and the tool's local stiffness
// (physics notes 3.7).
//
// A tool prescribes the velocities J u of its members c, u its twist about the tip. With the
// columns
//   A_ff w_k = A_fc J e_k,  f: the subspace,
// a residual r of the solve is an error w_k.r of the impulse on the tool along u_k, exactly; and
// the impulse changes by -(J^T A_cc J - J^T A_cf w) with u. The columns are found by conjugate
// gradients, one at a time, a few iterations a sub-step, each from where it was: they lag behind A.
// Constraint rows (implicit_rows.h) hold whatever r is: with m_k, what such a motion does to them,
// w_k becomes w_k + sum_rs w_r (m^-1)_rs m_ks, and the stiffness gains m_j m^-1 m_k.
// What they lack, s_k = A_fc J e_k - A_ff w_k, widens the bar: |s_k.A^-1 r| <= c |s_k| |r| in the
// preconditioner's norm.
//
// Nothing here moves anything: it is no part of the state, and begins anew with Forget(). Allocates
// at construction only.
class ForceError {
 public:
  struct Bar {
    bool known = false;  // false: the tool holds nothing
    double force_n = 0, torque_nm = 0;
    Mat3 stiffness_n_m = Mat3::Zero();
  };

  // `rows`: how many constraint rows the solver has.
  explicit ForceError(const Model& model, std::size_t rows = 0);

  void Forget();
  // After the last Solve() of a sub-step; `groups` as in it.
  void Update(const State& state, std::span<const RigidGroup> groups, double dt_s,
              ImplicitSolver* solver, Parallel* parallel);
  std::span<const Bar> bars() const { return bars_; }  // [#tools], of the last sub-step

 private:
  struct Column {
    std::vector<Padded> w;          // [#particles], in the subspace
    std::vector<double> row_speed;  // [#rows] m_k
    double lacking_sq = 0;          // s.P^-1 s
    Vec3 force_ns = Vec3::Zero();   // J^T (A_cc J - A_cf w) e_k, its force less that of inertia
  };
  static constexpr int kColumns = 6;
  Column& ColumnOf(int tool, int k) { return columns_[kColumns * tool + k]; }
  void Renew(const State& state, std::span<const RigidGroup> groups, int tool, int k,
             int iterations, SubspaceSystem* system, Parallel* parallel);
  std::uint64_t MembersOf(const State& state, int tool) const;
  template <typename Visit>
  void ForEachMember(const State& state, int tool, const Visit& visit) const;
  void SetMotion(const State& state, std::span<const RigidGroup> groups, int tool, int k);
  void MeasureRows(const State& state, std::span<const RigidGroup> groups, int tool,
                   const ImplicitRows& rows);
  void AddRowStiffness(int tool, double dt_s, ImplicitRows* rows, Bar* bar);

  const Model& model_;
  std::vector<Column> columns_;  // [#tools x 6]
  std::vector<std::uint64_t>
      members_;  // [#tools] a hash of the zones that columns are for; 0: none
  std::vector<Bar> bars_;
  std::vector<Padded> motion_, lacking_;        // [#particles]
  std::vector<double> row_speed_, row_answer_;  // [#rows]
  int next_ = 0;                                // the column whose turn it is
};

}  // namespace adhesim
