#pragma once

#include "core/model/lanes.h"

namespace adhesim {

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"

// Square roots, lane by lane (vectorised: this folder is compiled without errno for mathematics).
template <int kWidth>
ADHESIM_INLINE typename LaneMath<kWidth>::V SquareRoot(const typename LaneMath<kWidth>::V& v) {
  double lane[kWidth];
  std::memcpy(lane, &v, sizeof(lane));
  for (double& value : lane) value = __builtin_sqrt(value);
  typename LaneMath<kWidth>::V root;
  std::memcpy(&root, lane, sizeof(root));
  return root;
}

// a = axes diag(eigenvalue) axes^T of a symmetric 3 x 3 matrix, in no order: cyclic Jacobi. Four
// sweeps square the error four times over, from at most 1 to below round-off.
template <int kWidth>
ADHESIM_INLINE void SymmetricEigen(const typename LaneMath<kWidth>::V33& matrix,
                                   typename LaneMath<kWidth>::V eigenvalue[3],
                                   typename LaneMath<kWidth>::V33* axes) {
  using Math = LaneMath<kWidth>;
  using V = typename Math::V;
  const V zero{}, one = zero + 1.0;
  typename Math::V33 a = matrix;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) axes->m[i][j] = i == j ? one : zero;
  }
  for (int sweep = 0; sweep < 4; ++sweep) {
    for (int m = 2; m >= 0; --m) {
      const int k = (m + 1) % 3, l = (m + 2) % 3;
      // tan(2 angle) = 2 a_kl / (a_ll - a_kk); the angle of at most 45 degrees.
      const V d = a.m[l][l] - a.m[k][k], o = 2.0 * a.m[k][l];
      const V length = SquareRoot<kWidth>(d * d + o * o);
      const auto none = Math::Less(length, zero + 1e-150);
      const V size = Math::Select(none, one, length);
      const V ratio = Math::Select(none, one, Math::Abs(d) / size);
      const V cosine = SquareRoot<kWidth>(0.5 + 0.5 * ratio);
      const V turn = Math::Select(none, zero, o) / (2.0 * size * cosine);
      const V sine = Math::Select(Math::Less(d, zero), -turn, turn);
      const V akk = a.m[k][k], all = a.m[l][l], akl = a.m[k][l], akm = a.m[k][m], alm = a.m[l][m];
      a.m[k][k] = cosine * cosine * akk - 2.0 * cosine * sine * akl + sine * sine * all;
      a.m[l][l] = sine * sine * akk + 2.0 * cosine * sine * akl + cosine * cosine * all;
      a.m[k][l] = a.m[l][k] = (cosine * cosine - sine * sine) * akl + cosine * sine * (akk - all);
      a.m[k][m] = a.m[m][k] = cosine * akm - sine * alm;
      a.m[l][m] = a.m[m][l] = sine * akm + cosine * alm;
      for (int i = 0; i < 3; ++i) {
        const V ik = axes->m[i][k], il = axes->m[i][l];
        axes->m[i][k] = cosine * ik - sine * il;
        axes->m[i][l] = sine * ik + cosine * il;
      }
    }
  }
  for (int k = 0; k < 3; ++k) eigenvalue[k] = a.m[k][k];
}

// f = u diag(s) v^T with rotations u and v (columns), s_0 >= s_1 >= |s_2|: the sign of det f is
// that of s_2. Good to about 1e-8 of s_0, because it squares f: enough for a frame to project in.
template <int kWidth>
ADHESIM_INLINE void SignedSingularValues(const typename LaneMath<kWidth>::V33& f,
                                         typename LaneMath<kWidth>::V s[3],
                                         typename LaneMath<kWidth>::V33* u,
                                         typename LaneMath<kWidth>::V33* v) {
  using Math = LaneMath<kWidth>;
  using V = typename Math::V;
  using V3 = typename Math::V3;
  const V zero{}, one = zero + 1.0;
  typename Math::V33 c;  // f^T f
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      c.m[i][j] = f.m[0][i] * f.m[0][j] + f.m[1][i] * f.m[1][j] + f.m[2][i] * f.m[2][j];
    }
  }
  V square[3];
  SymmetricEigen<kWidth>(c, square, v);
  // The largest first, the smallest last.
  for (const auto& [k, l] : {std::pair(0, 1), std::pair(1, 2), std::pair(0, 1)}) {
    const auto swap = Math::Less(square[k], square[l]);
    const V upper = Math::Select(swap, square[l], square[k]);
    square[l] = Math::Select(swap, square[k], square[l]);
    square[k] = upper;
    for (int i = 0; i < 3; ++i) {
      const V ik = v->m[i][k], il = v->m[i][l];
      v->m[i][k] = Math::Select(swap, il, ik);
      v->m[i][l] = Math::Select(swap, ik, il);
    }
  }
  const auto dot = [](const V3& p, const V3& q) __attribute__((always_inline)) {
    return p.x * q.x + p.y * q.y + p.z * q.z;
  };
  const auto cross = [](const V3& p, const V3& q) __attribute__((always_inline)) {
    return V3{p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
  };
  const auto select =
      [](const auto& where, const V3& p, const V3& q) __attribute__((always_inline)) {
    return V3{Math::Select(where, p.x, q.x), Math::Select(where, p.y, q.y),
              Math::Select(where, p.z, q.z)};
  };
  const auto times = [](const V& factor, const V3& p) __attribute__((always_inline)) {
    return V3{factor * p.x, factor * p.y, factor * p.z};
  };
  const auto image = [&](const V3& p) __attribute__((always_inline)) {
    return V3{f.m[0][0] * p.x + f.m[0][1] * p.y + f.m[0][2] * p.z,
              f.m[1][0] * p.x + f.m[1][1] * p.y + f.m[1][2] * p.z,
              f.m[2][0] * p.x + f.m[2][1] * p.y + f.m[2][2] * p.z};
  };
  const V3 v0{v->m[0][0], v->m[1][0], v->m[2][0]}, v1{v->m[0][1], v->m[1][1], v->m[2][1]};
  const V3 v2 = cross(v0, v1);
  // Images normalised. Where there is none to speak of, any direction serves.
  const V3 f0 = image(v0), f1 = image(v1);
  const V size0 = SquareRoot<kWidth>(dot(f0, f0));
  const auto none0 = Math::Less(size0, zero + 1e-150);
  const V3 u0 = select(none0, v0, times(one / Math::Select(none0, one, size0), f0));
  const V along = dot(u0, f1);
  const V3 across{f1.x - along * u0.x, f1.y - along * u0.y, f1.z - along * u0.z};
  const auto wide = Math::Less(Math::Abs(u0.z), Math::Abs(u0.x));
  const V3 any = select(wide, V3{-u0.y, u0.x, zero}, V3{zero, -u0.z, u0.y});
  const auto none1 = Math::Less(dot(across, across), 1e-20 * size0 * size0 + 1e-300);
  const V3 second = select(none1, any, across);
  const V3 u1 = times(one / SquareRoot<kWidth>(dot(second, second)), second);
  const V3 u2 = cross(u0, u1);
  s[0] = dot(u0, f0);
  s[1] = dot(u1, f1);
  s[2] = dot(u2, image(v2));
  const V3 columns_u[3] = {u0, u1, u2};
  for (int k = 0; k < 3; ++k) {
    u->m[0][k] = columns_u[k].x;
    u->m[1][k] = columns_u[k].y;
    u->m[2][k] = columns_u[k].z;
  }
  v->m[0][2] = v2.x;
  v->m[1][2] = v2.y;
  v->m[2][2] = v2.z;
}
#pragma GCC diagnostic pop

}  // namespace adhesim
