#include <limits>

#include "core/effects/elasticity/symmetric_eigen.h"
#include "core/effects/elasticity/tet_kernel.h"
#include "core/model/polar.h"

namespace adhesim {

#pragma GCC diagnostic ignored "-Wpsabi"

namespace {

// psi = mu/2 (I_C - 3) + g(J), g(J) = -mu ln J + lambda/2 (ln J)^2, and below J_0 the second-order
// Taylor polynomial of g there: C2.
constexpr double kLeastJ = 0.2;                     // J_0
constexpr double kLogLeastJ = -1.6094379124341003;  // ln 0.2
// Where tr S, S the stretch of the polar decomposition, is below 3 J_0^(1/3), so is J below J_0.
constexpr double kLeastTrace = 1.7544106429277195;

template <int kWidth>
struct NeoHookean : TetKernel<kWidth> {
  using Math = LaneMath<kWidth>;
  using typename Math::Mask;
  using typename Math::V;
  using typename Math::V33;

  ADHESIM_INLINE V Constant(double value) { return V{} + value; }

  // ln(1 + y) for y >= -0.96, by arithmetic alone: 1 + y = 2^e m with m in [sqrt 1/2, sqrt 2), ln m
  // = 2 artanh s, s = (m - 1) / (m + 1), |s| < 0.172: the first omitted term is below 1e-17.
  // Relative error of the order of round-off for small y, too.
  ADHESIM_INLINE V LogOnePlus(const V& y) {
    const V u = 1.0 + y;
    constexpr std::int64_t kRootHalf = 0x3fe6a09e667f3bcd;
    const Mask e = (reinterpret_cast<Mask>(u) - kRootHalf) >> 52;
    const V m = reinterpret_cast<V>(reinterpret_cast<Mask>(u) - (e << 52));
    const Mask scaled = (e | -e) >> 63;  // e != 0
    const V t = Math::Select(scaled, m - 1.0, y);
    const V s = t / (2.0 + t), z = s * s;
    V series = Constant(1.0 / 21);
    for (int k = 19; k >= 3; k -= 2) series = series * z + 1.0 / k;
    // An integer as a number: added to the last bits of 1.5 * 2^52.
    const V exponent =
        reinterpret_cast<V>(e + std::int64_t{0x4338000000000000}) - 6755399441055744.0;
    return exponent * 0.6931471805599453 + (2.0 * s + 2.0 * s * z * series);
  }

  struct Volumetric {
    V j;                 // det F
    V trace;             // I_C - 3
    V g, first, second;  // g(J) and its derivatives, times V
    Mask crushed;        // J < J_0
  };
  // ln J = 1/2 ln(1 + (J^2 - 1)), and both I_C - 3 and J^2 - 1 come from C - I: near rest their
  // first-order parts cancel exactly, so that the energy is of second order in round-off, too.
  ADHESIM_INLINE Volumetric VolumetricOf(const V33& f, const V& shear, const V& lame) {
    V c[3][3];  // C - I
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) {
        c[i][j] = f.m[0][i] * f.m[0][j] + f.m[1][i] * f.m[1][j] + f.m[2][i] * f.m[2][j];
      }
      c[i][i] -= 1.0;
    }
    Volumetric at;
    at.trace = c[0][0] + c[1][1] + c[2][2];
    const V minors = c[0][0] * c[1][1] - c[0][1] * c[0][1] + c[0][0] * c[2][2] - c[0][2] * c[0][2] +
                     c[1][1] * c[2][2] - c[1][2] * c[1][2];
    const V determinant = c[0][0] * (c[1][1] * c[2][2] - c[1][2] * c[1][2]) -
                          c[0][1] * (c[0][1] * c[2][2] - c[1][2] * c[0][2]) +
                          c[0][2] * (c[0][1] * c[1][2] - c[1][1] * c[0][2]);
    at.j = f.m[0][0] * (f.m[1][1] * f.m[2][2] - f.m[1][2] * f.m[2][1]) -
           f.m[0][1] * (f.m[1][0] * f.m[2][2] - f.m[1][2] * f.m[2][0]) +
           f.m[0][2] * (f.m[1][0] * f.m[2][1] - f.m[1][1] * f.m[2][0]);
    at.crushed = Math::Less(at.j, Constant(kLeastJ));
    const V j = Math::Select(at.crushed, Constant(1), at.j);
    const V small = at.trace + minors + determinant;
    const Mask near = Math::Less(Math::Abs(small), Constant(0.25));
    const V log =
        0.5 * LogOnePlus(Math::Select(at.crushed, V{}, Math::Select(near, small, j * j - 1.0)));
    const V over = at.j - kLeastJ;
    const V g0 = (0.5 * kLogLeastJ * lame - shear) * kLogLeastJ;
    const V first0 = (kLogLeastJ * lame - shear) / kLeastJ;
    const V second0 = (shear + (1 - kLogLeastJ) * lame) / (kLeastJ * kLeastJ);
    at.g = Math::Select(at.crushed, g0 + (first0 + 0.5 * second0 * over) * over,
                        (0.5 * log * lame - shear) * log);
    at.first = Math::Select(at.crushed, first0 + second0 * over, (log * lame - shear) / j);
    at.second = Math::Select(at.crushed, second0, (shear + (1.0 - log) * lame) / (j * j));
    return at;
  }

  // P = mu F + g'(J) cof F.
  ADHESIM_INLINE V33 Stress(const V33& f, const V& shear, const V& first) {
    V33 p;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        const V cofactor = f.m[i1][j1] * f.m[i2][j2] - f.m[i1][j2] * f.m[i2][j1];
        p.m[i][j] = shear * f.m[i][j] + first * cofactor;
      }
    }
    return p;
  }

  // What a Hessian is in the frames U, V of F = U diag(s) V^T: with Z = U^T dF V,
  //   d2psi = sum A_kl Z_kk Z_ll + sum over k < l of (p_m (Z_kl^2 + Z_lk^2) + 2 q_m Z_kl Z_lk),
  // m the third index.
  struct Frames {
    V33 u, v;  // columns
    V33 a;     // A
    V p[3], q[3];
  };
  // mu |Z|^2 + g'' (cof F : dF)^2 + 2 g' sum s_m (Z_kk Z_ll - Z_kl Z_lk) with the magnitudes of its
  // eigenvalues. (Made zero, the negative ones would leave the force along them to inertia alone:
  // a block squashed flat was thrown apart in its first step.) Those of the pairs are mu - g' s_m
  // (symmetric) and mu + g' s_m (antisymmetric).
  ADHESIM_INLINE void Project(const V s[3], const V& shear, const V& first, const V& second,
                              Frames* h) {
    for (int m = 0; m < 3; ++m) {
      const V symmetric = Math::Abs(shear - first * s[m]);
      const V antisymmetric = Math::Abs(shear + first * s[m]);
      h->p[m] = 0.5 * (symmetric + antisymmetric);
      h->q[m] = 0.5 * (symmetric - antisymmetric);
    }
    // The collapse term is kappa/6 (t_0 - tr Z)^3, kappa = mu. What comes from the rotation's
    // change is negative: left out.
    const V collapse = shear * NotNegative(kLeastTrace - (s[0] + s[1] + s[2]));
    V33 a;
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l < 3; ++l) {
        const V dk = s[(k + 1) % 3] * s[(k + 2) % 3], dl = s[(l + 1) % 3] * s[(l + 2) % 3];
        a.m[k][l] = second * dk * dl + collapse + (k == l ? shear : first * s[3 - k - l]);
      }
    }
    V33 axes;
    V eigenvalue[3];
    SymmetricEigen<kWidth>(a, eigenvalue, &axes);
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l < 3; ++l) {
        h->a.m[k][l] = V{};
        for (int e = 0; e < 3; ++e) {
          h->a.m[k][l] += Math::Abs(eigenvalue[e]) * axes.m[k][e] * axes.m[l][e];
        }
      }
    }
  }
  ADHESIM_INLINE V NotNegative(const V& v) { return Math::Select(Math::Less(v, V{}), V{}, v); }

  // K_ij = U M U^T with M_kl = A_kl bi_k bj_l + q_m bi_l bj_k off the diagonal, M_kk = A_kk bi_k
  // bj_k
  // + sum over l != k of p_m bi_l bj_l, bi = V^T b_i.
  ADHESIM_INLINE void WriteBlocks(int first, const TetBatch& batch, const Frames& h,
                                  TetBlocks* out) {
    V33 turned;  // V^T
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l < 3; ++l) turned.m[k][l] = h.v.m[l][k];
    }
    typename Math::V3 b[4];
    TetKernel<kWidth>::TimesGradients(first, batch, turned, b);
    int pair = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i + 1; j < 4; ++j, ++pair) {
        const V bi[3] = {b[i].x, b[i].y, b[i].z}, bj[3] = {b[j].x, b[j].y, b[j].z};
        V33 um;  // U M
        for (int l = 0; l < 3; ++l) {
          V column[3];
          for (int k = 0; k < 3; ++k) {
            if (k == l) {
              const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
              column[k] = h.a.m[k][k] * bi[k] * bj[k] + h.p[k2] * bi[k1] * bj[k1] +
                          h.p[k1] * bi[k2] * bj[k2];
            } else {
              column[k] = h.a.m[k][l] * bi[k] * bj[l] + h.q[3 - k - l] * bi[l] * bj[k];
            }
          }
          for (int r = 0; r < 3; ++r) {
            um.m[r][l] =
                h.u.m[r][0] * column[0] + h.u.m[r][1] * column[1] + h.u.m[r][2] * column[2];
          }
        }
        V entry[9];
        for (int c = 0; c < 3; ++c) {
          for (int r = 0; r < 3; ++r) {
            entry[3 * c + r] =
                um.m[r][0] * h.u.m[c][0] + um.m[r][1] * h.u.m[c][1] + um.m[r][2] * h.u.m[c][2];
          }
        }
        NeoHookean::StoreBlocks(entry, first, out->block[pair]);
      }
    }
  }
};

}  // namespace

unsigned NeoHookeanForces(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                          TetForces* out) {
  unsigned crushed = 0;
  ForLanes(
      simd, [&](auto width, int first) __attribute__((always_inline)) {
        using Kernel = NeoHookean<decltype(width)::value>;
        const auto f = Kernel::Gradient(first, batch, position_m);
        const auto shear = Kernel::Load(batch.shear_j, first),
                   lame = Kernel::Load(batch.lame_j, first);
        const auto at = Kernel::VolumetricOf(f, shear, lame);
        const auto energy = 0.5 * shear * at.trace + at.g;
        // Round-off can make it negative at rest. What is no number stays one.
        const auto below = Kernel::Select(Kernel::Less(energy, 0.0 * energy), energy, 0.0 * energy);
        Kernel::Store(energy - below, &out->energy_j, first);
        Kernel::Exert(first, batch, Kernel::Stress(f, shear, at.first), out->elastic_n);
        crushed |= Kernel::Bits(at.crushed) << first;
      });
  return crushed;
}

// psi + mu/6 (t_0 - t)^3 where t = tr(R^T F) < t_0: without it F = 0 would be a minimum of the
// energy, since mu/2 I_C has one there and g(J) is flat. dt/dF = R.
void AddCollapseForces(const TetBatch& batch, int lane, std::span<const Vec3> position_m,
                       TetForces* out) {
  const Mat3 f = DeformationGradient(batch, lane, position_m);
  const Mat3 rotation = PolarRotation(f, Quat::Identity()).toRotationMatrix();
  const double missing = kLeastTrace - rotation.cwiseProduct(f).sum();
  if (!(missing > 0)) return;
  const double shear_j = batch.shear_j.v[lane];
  out->energy_j.v[lane] += shear_j / 6 * missing * missing * missing;
  const std::array<Vec3, 4> b = GradientsOf(batch, lane);
  for (int a = 0; a < 4; ++a) {
    const Vec3 force = 0.5 * shear_j * missing * missing * (rotation * b[a]);
    SetLane(LaneOf(out->elastic_n[a], lane) + force, lane, &out->elastic_n[a]);
  }
}

void NeoHookeanStiffness(Simd simd, const TetBatch& batch, std::span<const Vec3> position_m,
                         double scale, TetBlocks* out) {
  ForLanes(
      simd, [&](auto width, int first) __attribute__((always_inline)) {
        using Kernel = NeoHookean<decltype(width)::value>;
        const auto f = Kernel::Gradient(first, batch, position_m);
        const auto shear = scale * Kernel::Load(batch.shear_j, first),
                   lame = scale * Kernel::Load(batch.lame_j, first);
        const auto at = Kernel::VolumetricOf(f, shear, lame);
        typename Kernel::Frames h;
        typename Kernel::V stretch[3];
        SignedSingularValues<decltype(width)::value>(f, stretch, &h.u, &h.v);
        Kernel::Project(stretch, shear, at.first, at.second, &h);
        Kernel::WriteBlocks(first, batch, h, out);
      });
}

}  // namespace adhesim
