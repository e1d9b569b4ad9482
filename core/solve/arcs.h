#pragma once

#include <span>
#include <vector>

#include "core/model/model.h"
#include "core/model/state.h"
#include "core/solve/rigid_group.h"

namespace adhesim {

// By how much the particles of bodies that turn as a whole leave their tangents in a step.
//
// A particle moves on a straight line in a step, and what a linear step knows of forces at its end
// is f - dt K v. A body that turns as a whole by the angle a = dt |w| would lie on its tangents
// then, stretched by a^2 / 2, and not be pulled back before the next step: its elastic energy is
// 1/8 K a^4 in each, many times the energy of its motion where it is stiff, and what a solver's
// tolerance leaves of such forces feeds itself. So the equation is written for the velocity
// less what the arc adds to it,
//   v - c,  c_i = ((R - 1) / dt - [w]) (x_i - x_c),  R the rotation by dt w,
// which strains nothing where the body just turns. w is that of the angular momentum that the body
// ends the step with, as far as forces at its start tell: a step of backward Euler goes by the
// velocity at its end, and what swings under gravity turns by other than dt w_n in a long one.
// About its centre of mass where it is free, else about what holds it (fixed particles, zones with
// pins, tools) where that leaves a turn: about a point, an axis, or a tool's first member. Zones
// and tools turn on arcs by themselves.
//
// Allocates at construction only.
class Arcs {
 public:
  explicit Arcs(const Model& model);

  // `force_n` [#particles] acts in the step.
  void Update(const State& state, std::span<const Vec3> force_n, double dt_s);
  // The widest turn of a body in the step, rad.
  double widest_rad() const { return widest_rad_; }
  bool turns(int body) const { return of_[body].turns; }
  // Of a body at the state's positions, by these velocities, rad/s.
  double FastestTurn(const State& state, std::span<const Vec3> velocity_m_s) const;
  // c of a particle at x, m/s.
  Vec3 At(int body, const Vec3& x) const {
    return of_[body].turns ? Vec3(of_[body].bend * (x - of_[body].centre_m)) : Vec3::Zero();
  }
  // What v on the way to x at the end of the step lacks to the tangent there, but for a
  // translation: the same way back.
  Vec3 AtEnd(int body, const Vec3& x) const {
    return of_[body].turns ? Vec3(of_[body].bend.transpose() * (x - of_[body].centre_m))
                           : Vec3::Zero();
  }
  // w x (x - x_c), the tangent of that turn, m/s.
  Vec3 Turning(int body, const Vec3& x) const {
    return of_[body].turns ? Vec3(of_[body].turn_rad_s.cross(x - of_[body].centre_m))
                           : Vec3::Zero();
  }

 private:
  struct Arc {
    bool tissue, turns;
    Vec3 centre_m, turn_rad_s;
    Mat3 bend;  // 1/s
  };
  // Of a body, rad/s, about `centre_m`, after forces (or none) have acted for dt_s; zero where it
  // cannot turn.
  Vec3 TurnOf(std::size_t body, const State& state, std::span<const Vec3> velocity_m_s,
              std::span<const Vec3> force_n, double dt_s, Vec3* centre_m) const;
  Hold HoldOf(const Body& body, const State& state, int* about) const;

  const Model& model_;
  std::vector<Arc> of_;  // [#bodies]
  double widest_rad_ = 0;
};

}  // namespace adhesim
