#include "core/scene/mesh/measure_tets.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace adhesim {
namespace {

using Mat6x12 = Eigen::Matrix<double, 6, 12>;

constexpr double kDegrees = 180 / std::numbers::pi;

struct Shape {
  double volume = 0;
  std::array<Vec3, 4> area;  // outward area vectors of the faces; face k lies opposite corner k
  double circumradius = 0;
};

Shape ShapeOf(const std::array<Vec3, 4>& corner) {
  Shape shape;
  const auto& [a, b, c, d] = corner;
  shape.volume = TetVolume(a, b, c, d);
  for (int k = 0; k < 4; ++k) {
    const Vec3& p = corner[kTetFaces[k][0]];
    shape.area[k] = 0.5 * (corner[kTetFaces[k][1]] - p).cross(corner[kTetFaces[k][2]] - p);
  }
  // The point at the same distance from all corners, from corner a.
  const Vec3 u = b - a, v = c - a, w = d - a;
  const Vec3 centre =
      (u.squaredNorm() * v.cross(w) + v.squaredNorm() * w.cross(u) + w.squaredNorm() * u.cross(v)) /
      (12 * shape.volume);
  shape.circumradius = centre.norm();
  return shape;
}

std::array<Vec3, 4> CornersOf(const TetMesh& mesh, const Tetrahedron& t) {
  const std::vector<Vec3>& nodes = mesh.surface.vertices;
  return {nodes[t[0]], nodes[t[1]], nodes[t[2]], nodes[t[3]]};
}

int CountComponents(const TetMesh& mesh) {
  std::vector<std::int32_t> parent(mesh.tetrahedra.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  const std::vector<TetFace> faces = SortedFaces(mesh.tetrahedra);
  for (std::size_t f = 1; f < faces.size(); ++f) {
    if (faces[f].sorted != faces[f - 1].sorted) continue;
    parent[root(faces[f].tetrahedron)] = root(faces[f - 1].tetrahedron);
  }
  int count = 0;
  for (std::size_t t = 0; t < parent.size(); ++t) count += parent[t] == static_cast<int>(t);
  return count;
}

// Strains (xx, yy, zz, and the shears xy, yz, zx as engineers write them) from the corners'
// displacements.
Mat6x12 StrainsOf(const Shape& shape) {
  Mat6x12 strains = Mat6x12::Zero();
  for (int k = 0; k < 4; ++k) {
    const Vec3 g = -shape.area[k] / (3 * shape.volume);  // gradient of the corner's weight
    strains.block<6, 3>(0, 3 * k) << g.x(), 0, 0, 0, g.y(), 0, 0, 0, g.z(), g.y(), g.x(), 0, 0,
        g.z(), g.y(), g.z(), 0, g.x();
  }
  return strains;
}

}  // namespace

TetReport MeasureTets(const TetMesh& mesh) {
  TetReport report;
  report.carried = static_cast<int>(mesh.carried.size());
  report.nodes = static_cast<int>(mesh.surface.vertices.size()) - report.carried;
  report.tetrahedra = static_cast<int>(mesh.tetrahedra.size());
  report.components = CountComponents(mesh);
  report.filled_m3 = FilledVolume(mesh);
  double least_cosine = 1, greatest_cosine = -1, ratios = 0;
  report.min_edge_m = report.min_radius_ratio = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const std::array<Vec3, 4> corner = CornersOf(mesh, mesh.tetrahedra[t]);
    const Shape shape = ShapeOf(corner);
    double area = 0;
    for (int i = 0; i < 4; ++i) {
      area += shape.area[i].norm();
      for (int j = i + 1; j < 4; ++j) {
        // Outward normals that are opposite enclose an angle of zero.
        const double cosine = -shape.area[i].normalized().dot(shape.area[j].normalized());
        least_cosine = std::min(least_cosine, cosine);
        greatest_cosine = std::max(greatest_cosine, cosine);
        report.min_edge_m = std::min(report.min_edge_m, (corner[i] - corner[j]).norm());
      }
    }
    const double ratio = 3 * (3 * shape.volume / area) / shape.circumradius;
    report.min_radius_ratio = std::min(report.min_radius_ratio, ratio);
    ratios += ratio;
    report.volume_m3 += shape.volume;
    if (mesh.label[t] >= 0) report.label_m3[mesh.label[t]] += mesh.fill[t] * shape.volume;
    if (mesh.group[t] >= 0) {
      report.group_m3[mesh.group_names[mesh.group[t]]] += mesh.fill[t] * shape.volume;
    }
  }
  report.mean_radius_ratio = ratios / static_cast<double>(mesh.tetrahedra.size());
  report.min_dihedral_deg = std::acos(std::clamp(greatest_cosine, -1.0, 1.0)) * kDegrees;
  report.max_dihedral_deg = std::acos(std::clamp(least_cosine, -1.0, 1.0)) * kDegrees;
  return report;
}

double StableStep(const TetMesh& mesh, const TissueMaterial& material) {
  const double e = material.young_modulus_pa, nu = material.poisson_ratio;
  const double mu = e / (2 * (1 + nu)), lambda = e * nu / ((1 + nu) * (1 - 2 * nu));
  Mat6 stiffness = Mat6::Zero();
  stiffness.topLeftCorner<3, 3>().setConstant(lambda);
  stiffness.diagonal() << lambda + 2 * mu, lambda + 2 * mu, lambda + 2 * mu, mu, mu, mu;
  const Mat6 root = stiffness.llt().matrixL();
  double w_sq = 0;
  for (const Tetrahedron& t : mesh.tetrahedra) {
    // K = V B' D B and M = rho V / 4: the eigenvalues of K / M are those of (4 / rho) R' B B' R
    // with D = R R'.
    const Mat6x12 strains = StrainsOf(ShapeOf(CornersOf(mesh, t)));
    const Mat6 product = root.transpose() * (strains * strains.transpose()) * root;
    const Eigen::SelfAdjointEigenSolver<Mat6> solver(product, Eigen::EigenvaluesOnly);
    w_sq = std::max(w_sq, 4 / material.density_kg_m3 * solver.eigenvalues()[5]);
  }
  return 2 / std::sqrt(w_sq);
}

}  // namespace adhesim
