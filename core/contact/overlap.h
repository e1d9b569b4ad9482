#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/carried.h"
#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Bodies that lie in each other when a scene begins, and how they come apart.
//
// Depth and direction are consistent over a whole overlap (Heidelberger, Teschner, Keiser, Mueller
// and Gross 2004): particles inside that have a neighbour outside take them from where their edges
// pierce the other surface; further in, they are averages of what the neighbours nearer to the
// border have. The nearest surface point would send neighbouring particles to different sides.
//
// Separate() moves positions only, in proportion to inverse masses, so that no velocity is added
// and the common centre of mass stays (in the spirit of Spillmann, Becker and Teschner 2007). Two
// bodies that lie deep in each other move apart as wholes, the mean way of their particles: that
// strains nothing, where pushing each particle its own way wraps the one around the other. What is
// shallow, or held, goes particle against triangle.
class Overlap {
 public:
  explicit Overlap(const Model& model);

  // A particle inside another closed body.
  struct Inside {
    std::int32_t particle, body;
    double depth_m;
    Vec3 direction;  // unit, out of the body
  };
  // All of them, body by body, but those that nothing can move: fixed particles inside fixed
  // bodies. Time: particles in common boxes x triangles.
  std::span<const Inside> Find(std::span<const Vec3> position_m);

  // Moves what Find() found a part of the way out, at most `limit_m` each. Rigid bodies always move
  // as wholes.
  void Separate(double limit_m, std::span<Vec3> position_m);

 private:
  struct Exit {
    int triangle;
    Vec3 weights;
  };
  Exit ExitOf(const Inside& at, std::span<const Vec3> position_m) const;
  // Change of position for an impulse of one along the direction, 1/kg.
  double Mobility(int particle) const;
  // Moves it by its mobility times the push.
  void Move(int particle, const Vec3& push, std::span<Vec3> position_m) const;
  void FindIn(int body, std::span<const Vec3> position_m);
  void MeasureBorder(std::span<const Vec3> position_m);
  void SpreadInward(std::span<const Vec3> position_m);
  void MeasureTheRest(std::span<const Vec3> position_m);
  Vec3 InnerPoint(int particle, std::span<const Vec3> position_m) const;
  // Two bodies that lie in each other.
  struct Pair {
    std::int32_t first, second;  // ascending
    Vec3 apart;                  // sum of directions: of `first`, out of `second`, and back
    double depth_m;              // most
    bool whole;                  // they move apart as wholes
  };
  static bool PairLess(const Pair& a, const Pair& b) {
    return a.first != b.first ? a.first < b.first : a.second < b.second;
  }
  Pair& PairOf(const Inside& at);
  void MoveWholes(double limit_m, std::span<Vec3> position_m);
  void MoveBody(int body, const Vec3& by, std::span<Vec3> position_m) const;

  const Model& model_;
  std::vector<Inside> inside_;
  std::vector<Aabb> box_;             // [#bodies]
  std::vector<double> body_mass_kg_;  // [#bodies]
  CarriedLookup carried_;
  std::vector<std::uint8_t> held_;      // [#bodies] with a fixed particle
  std::vector<Pair> pair_;              // ascending
  std::vector<std::int32_t> involved_;  // [#bodies] how many of inside_ move it, if it is rigid
  // Scratch of one body's particles inside.
  std::size_t first_ = 0;            // into inside_
  std::vector<std::int32_t> at_;     // [#particles] into inside_, or -1
  std::vector<std::uint8_t> layer_;  // [#inside] 0: not measured, 1: measured, 2: in this round
};

}  // namespace adhesim
