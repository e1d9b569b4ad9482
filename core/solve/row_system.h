#pragma once

#include <span>

#include "core/model/geometry.h"
#include "core/model/parallel.h"

namespace adhesim {

// A particle's three numbers and a zero: one vector register.
struct alignas(32) Padded {
  double v[4] = {};
  Vec3 vec() const { return {v[0], v[1], v[2]}; }
  void Set(const Vec3& x) {
    for (int k = 0; k < 3; ++k) v[k] = x(k);
  }
};

// What contacts that slide are met in: a symmetric, positive definite matrix on velocities.
// Vectors have an entry a particle; where tools are unknown too (ToolSystem), two more each: linear
// and angular of their twists, or of wrenches on them, about their tips.
class RowSystem {
 public:
  virtual ~RowSystem() = default;
  // y = A x; returns x.y.
  virtual double Multiply(std::span<const Padded> x, std::span<Padded> y,
                          Parallel* parallel) const = 0;
  // z = P^-1 r; returns r.z.
  virtual double Precondition(std::span<const Padded> r, std::span<Padded> z,
                              Parallel* parallel) const = 0;
  // r += an impulse on a particle, or on a tool at a point, N s, as far as they are unknown.
  virtual void Push(int particle, const Vec3& impulse_ns, std::span<Padded> r) const = 0;
  virtual void PushTool(int tool, const Vec3& point_m, const Vec3& impulse_ns,
                        std::span<Padded> r) const = 0;
  // The velocity in x of a tool at a point; 0 of tools that are prescribed.
  virtual Vec3 ToolVelocity(int tool, const Vec3& point_m, std::span<const Padded> x) const = 0;
};

}  // namespace adhesim
