#include "core/model/polar.h"

#include <Eigen/SVD>

namespace adhesim {
namespace {

Quat RotationBySvd(const Mat3& a) {
  const Eigen::JacobiSVD<Mat3> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) = -u.col(2);
  return Quat(Mat3(u * svd.matrixV().transpose())).normalized();
}

// Cholesky solve of a symmetric 3x3; false when it is not positive definite.
bool SolvePositive(const Mat3& h, const Vec3& g, double floor, Vec3* x) {
  const double l00_sq = h(0, 0);
  if (!(l00_sq > floor)) return false;
  const double l00 = std::sqrt(l00_sq), l10 = h(1, 0) / l00, l20 = h(2, 0) / l00;
  const double l11_sq = h(1, 1) - l10 * l10;
  if (!(l11_sq > floor)) return false;
  const double l11 = std::sqrt(l11_sq), l21 = (h(2, 1) - l20 * l10) / l11;
  const double l22_sq = h(2, 2) - l20 * l20 - l21 * l21;
  if (!(l22_sq > floor)) return false;
  const double l22 = std::sqrt(l22_sq);
  const double y0 = g(0) / l00, y1 = (g(1) - l10 * y0) / l11,
               y2 = (g(2) - l20 * y0 - l21 * y1) / l22;
  const double x2 = y2 / l22, x1 = (y1 - l21 * x2) / l11;
  *x = Vec3((y0 - l10 * x1 - l20 * x2) / l00, x1, x2);
  return true;
}

}  // namespace

// Newton on rotations: with S = R^T A and R <- R exp(d), trace(R^T A) grows by d.a - 1/2 d^T (tr(S)
// I - sym S) d, where a is the axial vector of S. Convergence is quadratic, so a step below 1e-8
// leaves nothing but round-off.
Quat PolarRotation(const Mat3& a, const Quat& start) {
  Quat q = start;
  const double size = a.norm();
  if (!(size > 0) || !std::isfinite(size)) return q;
  bool restarted = false;
  for (int iteration = 0; iteration < 16; ++iteration) {
    const Mat3 s = q.toRotationMatrix().transpose() * a;
    const Vec3 axial(s(2, 1) - s(1, 2), s(0, 2) - s(2, 0), s(1, 0) - s(0, 1));
    const Mat3 h = Mat3::Identity() * s.trace() - 0.5 * (s + s.transpose());
    Vec3 step;
    if (!SolvePositive(h, axial, 1e-12 * size, &step) || step.squaredNorm() > 4) {
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
