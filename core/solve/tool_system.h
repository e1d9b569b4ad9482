#pragma once

#include <span>
#include <vector>

#include "core/model/model.h"
#include "core/model/parallel.h"
#include "core/model/state.h"
#include "core/solve/implicit_solver.h"

namespace adhesim {

// The twists of tools, found together with the velocities of the implicit tissue that they hold or
// that slides on them.
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
// Contacts that slide (ContactRows) are met within the same equation once it has been solved
// without them. Their impulses, too, are where those of the step's own solve start.
//
// Vectors have two entries a tool behind those of the particles (RowSystem).
//
// Allocates at construction only.
class ToolSystem : public RowSystem {
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
             double dt_s, ImplicitSolver* solver, Parallel* parallel,
             const SlidingContacts& slides = {});
  // The tool holds tissue, or some slides on it.
  bool has(int tool) const { return tools_[tool].zone >= 0 || tools_[tool].slides; }
  // Changes of twist [#tools] under these laws; goes on from those of the last call.
  void Solve(std::span<const Law> laws, StepReport* report, Parallel* parallel);
  Vec6 change(int tool) const { return Of(tool, change_m_s_); }
  // What goes with them, for the particles [#particles].
  std::span<const Padded> change_m_s() const {
    return std::span(change_m_s_).first(model_.particle_count());
  }

  double Multiply(std::span<const Padded> x, std::span<Padded> y,
                  Parallel* parallel) const override;
  double Precondition(std::span<const Padded> r, std::span<Padded> z,
                      Parallel* parallel) const override;
  void Push(int particle, const Vec3& impulse_ns, std::span<Padded> r) const override;
  void PushTool(int tool, const Vec3& point_m, const Vec3& impulse_ns,
                std::span<Padded> r) const override;
  Vec3 ToolVelocity(int tool, const Vec3& point_m, std::span<const Padded> x) const override;

 private:
  struct Tool {
    int zone = -1;          // held by it, and no sleeper in it
    bool slides = false;    // something does on it
    Mat6 members, inverse;  // J^T A_cc J; and (.. + law.matrix)^-1
    Law law;
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
  double RowSpeed(std::size_t row, std::span<const Padded> x) const;
  Vec6 Of(int tool, std::span<const Padded> x) const;
  void Add(int tool, const Vec6& change, std::span<Padded> x) const;
  void Iterate(double target, double rz, StepReport* report, Parallel* parallel);
  void MeetSlides(StepReport* report, Parallel* parallel);

  const Model& model_;
  ImplicitSolver* solver_ = nullptr;
  const State* state_ = nullptr;
  std::vector<Tool> tools_;       // [#tools]
  std::vector<Spring> rows_;      // [#rows]
  std::vector<Vec3> position_m_;  // [#particles]
  bool pushed_ = false;           // what rows lack is in the residuals
  std::span<const RigidGroup> groups_;
  ContactRows* slides_ = nullptr;  // of this sub-step; null: nothing can slide
  bool slides_met_ = false;        // under some laws: it goes on from there
  // [#particles, tools' two]
  std::vector<Padded> change_m_s_, residual_ns_, direction_, product_, step_;
};

}  // namespace adhesim
