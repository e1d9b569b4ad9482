#pragma once

#include <span>
#include <vector>

#include "core/model/model.h"
#include "core/model/parallel.h"
#include "core/model/state.h"
#include "core/solve/implicit_solver.h"

namespace adhesim {

// The twists of tools, found together with the velocities of the implicit tissue that they hold.
//
// A tool that feels only the force at the start of a step swings on tissue that is stiff against
// its mass over dt^2. With A, the free velocities f and a tool's members c as in ForceError, r what
// the step's equation lacks at the velocities before it (tools' members at J u_n), and a tool's own
// equation B du = g,
//   A_ff dv             + A_fc J du             = r_f
//   J^T A_cf dv + (J^T A_cc J + B) du           = J^T r_c + g
// is symmetric and positive definite, and the limit of no tissue is the tool alone. It is solved by
// conjugate gradients with the blocks of SubspaceSystem and of the tools as preconditioner; only du
// is kept, and dv as the start of the step's own solve, to which the tools are prescribed.
//
// Where tools hold all that could move of a constraint row (ImplicitRows), it takes part as a
// spring on their twists, rho (J^T g) (J^T g)^T with rho far above what tissue answers: they feel
// that a volume does not yield. What the spring exerts is where the row's multiplier starts.
//
// Allocates at construction only.
class ToolSystem {
 public:
  // A tool's own equation: of its mass and its coupling.
  struct Law {
    Mat6 matrix = Mat6::Zero();
    Vec6 impulse = Vec6::Zero();
  };

  // `rows`: how many the solver has.
  ToolSystem(const Model& model, std::size_t rows);

  // After ImplicitSolver::Begin(), with the twists that tools have and their own inertias [#tools].
  // True when tissue could throw some tool about within a step: its stiffness, with what is around
  // held still, is more than the inertia of tool and members over dt^2. Otherwise the force at the
  // start will do, and costs nothing.
  bool Begin(const State& state, std::span<const RigidGroup> groups, std::span<const Mat6> own,
             double dt_s, ImplicitSolver* solver, Parallel* parallel);
  bool holds(int tool) const { return tools_[tool].zone >= 0; }
  // Changes of twist [#tools] under these laws; goes on from those of the last call.
  void Solve(std::span<const Law> laws, StepReport* report, Parallel* parallel);
  const Vec6& change(int tool) const { return tools_[tool].change; }
  // What goes with them, for the particles [#particles].
  std::span<const Padded> change_m_s() const { return change_m_s_; }

 private:
  struct Tool {
    int zone = -1;          // held by it, and no sleeper in it
    Mat6 members, inverse;  // J^T A_cc J; and (.. + law.matrix)^-1
    Law law;
    Vec6 change, residual, direction, product, step;
    std::vector<Vec6> gradient;  // [#rows] J^T g_r
  };
  struct Spring {
    double stiffness = 0;  // rho, kg over the gradient's square; 0: something else yields
    double lacks = 0;      // of g.v, before the step: the gradient's unit times m/s
  };
  // J^T of rows of members: of A x, or of x itself.
  template <typename Row>
  Vec6 SumOverMembers(const Tool& tool, const Row& row) const;
  void SetMembers(const Tool& tool, const Vec6& twist, std::span<Padded> x) const;
  void MakeRows(std::span<const RigidGroup> groups, double dt_s);
  // J^T g_r.
  Vec6 GradientOf(const Tool& tool, std::size_t row) const;
  double RowSpeed(std::size_t row, Vec6 Tool::*motion) const;
  double Precondition(Parallel* parallel);
  double Multiply(Parallel* parallel);

  const Model& model_;
  ImplicitSolver* solver_ = nullptr;
  const State* state_ = nullptr;
  std::vector<Tool> tools_;       // [#tools]
  std::vector<Spring> rows_;      // [#rows]
  std::vector<Vec3> position_m_;  // [#particles]
  bool pushed_ = false;           // what rows lack is in the residuals
  std::vector<Padded> change_m_s_, residual_ns_, direction_, product_, step_;  // [#particles]
};

}  // namespace adhesim
