#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/model/effect.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/solve/subspace_system.h"

namespace adhesim {

// Constraint rows of an implicit step: one impulse lambda_r along the gradient g_r at x_n of each,
// sized so that the rows hold at x_{n+1} = x_n + dt v. Unlike rows that are met after the solve
// they act through the whole of A: with the responses and the rows' mobility
//   w_r = A^-1 g_r in the subspace,   m_rs = g_r.w_s,
// lambda changes velocities by sum_r lambda_r w_r, so that what a row presses on is as stiff as it
// is.
//
// A row is a function of volumes: its gradient sums to zero, and so does its impulse on all
// particles. Memory and time go with rows x particles. Allocates at construction only.
class ImplicitRows {
 public:
  // `effects`: those that have rows; they outlive this.
  ImplicitRows(const Model& model, std::vector<const Effect*> effects);
  bool empty() const { return row_.empty(); }
  std::size_t count() const { return row_.size(); }

  // Once a sub-step: gradients at its start.
  void Begin(std::span<const Vec3> position_m);
  // Once for every set of zones.
  void Start() { multiplier_ns_ = start_ns_; }
  // Where multipliers start until the next Begin(): what tools were moved by. A row of which tools
  // hold all that could move is answered by that alone.
  void SetStart(std::size_t row, double multiplier_ns) { start_ns_[row] = multiplier_ns; }
  // Responses of the system as it is now, each to a relative tolerance; returns the iterations.
  int Respond(double tolerance, int max_iterations, SubspaceSystem* system, Parallel* parallel,
              StepReport* report);
  // Largest relative error of a row at x_{n+1} [#particles]; writes the carried ones of these.
  double Measure(double dt_s, std::span<Vec3> position_m);
  // Changes the multipliers by what would end the errors last measured; with them velocities, and
  // what their solve has left open.
  void Advance(std::span<Padded> velocity_m_s, std::span<Padded> left_ns);
  // Takes the last Advance() back.
  void GoBack(std::span<Padded> velocity_m_s, std::span<Padded> left_ns);

  // Of the rows on a particle, N s.
  Vec3 ImpulseOn(int p) const {
    return empty() || row_of_[p] < 0 ? Vec3::Zero()
                                     : Vec3(multiplier_ns_[row_of_[p]] * gradient_[p]);
  }
  std::span<const double> multipliers() const { return multiplier_ns_; }  // [#rows] N s a gradient

  // g_r.v, m^-1 of such speeds, and w_r.f [#rows]: for what else is solved with A.
  double SpeedOf(std::size_t row, std::span<const Padded> velocity_m_s) const;
  // g_r.v that would end the error last measured.
  double MissingSpeed(std::size_t r) const { return speed_[r]; }
  const ConstraintRow& row(std::size_t r) const { return row_[r]; }
  const Vec3& gradient(int p) const { return gradient_[p]; }
  void AnswerTo(std::span<const double> speed, std::span<double> answer);
  void ResponsesTo(std::span<const Padded> impulse_ns, std::span<double> speed) const;

 private:
  void AddChange(std::span<Padded> velocity_m_s, std::span<Padded> left_ns);

  const Model& model_;
  std::vector<const Effect*> effects_;
  std::vector<ConstraintRow> row_;             // [#rows]
  std::vector<std::int32_t> row_of_;           // [#particles], -1: none
  std::vector<Vec3> gradient_;                 // [#particles]
  std::vector<std::vector<Padded>> response_;  // [#rows][#particles]
  std::vector<std::vector<Padded>> left_;      // [#rows][#particles] of their solves
  std::vector<double> mobility_, factor_;      // [#rows x #rows]
  std::vector<double> multiplier_ns_, start_ns_, speed_, change_;  // [#rows]
  std::vector<std::uint8_t> dropped_;                              // [#rows] nothing can change it
  std::vector<Padded> scratch_;                                    // [#particles]
};

}  // namespace adhesim
