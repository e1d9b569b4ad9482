#include "core/model/polar.h"

#include <Eigen/SVD>
#include <cmath>

namespace adhesim {
namespace {

Quat RotationBySvd(const Mat3& a) {
  const Eigen::JacobiSVD<Mat3> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) = -u.col(2);
  return Quat(Mat3(u * svd.matrixV().transpose())).normalized();
}

// Solves h x = g for a symmetric positive definite h by its adjugate; false when it is not (Sylvester's criterion).
bool SolvePositive(const Mat3& h, const Vec3& g, double floor, Vec3* x) {
  const double a = h(0, 0), b = h(1, 0), c = h(2, 0), d = h(1, 1), e = h(2, 1), f = h(2, 2);
  const double aa = d * f - e * e, ab = c * e - b * f, ac = b * e - c * d;
  const double determinant = a * aa + b * ab + c * ac;
  const double minor = a * d - b * b;
  if (!(a > floor) || !(minor > floor * a) || !(determinant > floor * minor)) return false;
  const double bb = a * f - c * c, bc = b * c - a * e;
  const double scale = 1 / determinant;
  *x = Vec3(scale * (aa * g(0) + ab * g(1) + ac * g(2)), scale * (ab * g(0) + bb * g(1) + bc * g(2)),
            scale * (ac * g(0) + bc * g(1) + minor * g(2)));
  return true;
}

}  // namespace

// Newton on rotations: with S = R^T A and R <- R exp(d), trace(R^T A) grows by d.a - 1/2 d^T (tr(S)
// I - sym S) d, where a is the axial vector of S. Convergence is quadratic, so a step below 1e-8
// leaves nothing but round-off.
Quat PolarRotation(const Mat3& a, const Quat& start) {
  Quat q = start;
  const double size_sq = a.squaredNorm();
  if (!(size_sq > 0) || !std::isfinite(size_sq)) return q;
  const double floor = 1e-12 * std::sqrt(size_sq);
  bool restarted = false;
  for (int iteration = 0; iteration < 16; ++iteration) {
    const Mat3 s = q.toRotationMatrix().transpose() * a;
    const Vec3 axial(s(2, 1) - s(1, 2), s(0, 2) - s(2, 0), s(1, 0) - s(0, 1));
    Mat3 h;   // tr(S) I - sym S; only the lower half is read
    h(0, 0) = s(1, 1) + s(2, 2);
    h(1, 1) = s(0, 0) + s(2, 2);
    h(2, 2) = s(0, 0) + s(1, 1);
    h(1, 0) = -0.5 * (s(1, 0) + s(0, 1));
    h(2, 0) = -0.5 * (s(2, 0) + s(0, 2));
    h(2, 1) = -0.5 * (s(2, 1) + s(1, 2));
    Vec3 step;
    if (!SolvePositive(h, axial, floor, &step) || step.squaredNorm() > 4) {
      if (restarted) return q;
      q = RotationBySvd(a);  // not near a maximum: inverted or tumbling
      restarted = true;
      continue;
    }
    q = q * Quat(1, 0.5 * step.x(), 0.5 * step.y(), 0.5 * step.z());
    q.normalize();
    if (step.squaredNorm() < 1e-16) return q;
  }
  return restarted ? q : RotationBySvd(a);
}

}  // namespace adhesim
