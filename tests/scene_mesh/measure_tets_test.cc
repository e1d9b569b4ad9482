#include "core/scene/mesh/measure_tets.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/scene/mesh/lattice.h"
#include "tests/scene_mesh/tet_files.h"

namespace adhesim {
namespace {

TetMesh OneTetrahedron(const std::vector<Vec3>& corners) {
  TetMesh mesh;
  mesh.surface.vertices = corners;
  mesh.tetrahedra = {{0, 1, 2, 3}};
  mesh.fill = {1};
  mesh.label = mesh.group = {-1};
  return mesh;
}

TEST(MeasureTets, KnowsTheRegularTetrahedron) {
  const TetMesh mesh = OneTetrahedron({{1, 1, 1}, {-1, 1, -1}, {1, -1, -1}, {-1, -1, 1}});
  ASSERT_GT(TetVolume(mesh.surface.vertices, mesh.tetrahedra[0]), 0);
  const TetReport report = MeasureTets(mesh);
  EXPECT_NEAR(report.min_dihedral_deg, std::acos(1.0 / 3) * 180 / M_PI, 1e-12);
  EXPECT_NEAR(report.max_dihedral_deg, report.min_dihedral_deg, 1e-12);
  EXPECT_NEAR(report.min_radius_ratio, 1, 1e-14);
  EXPECT_NEAR(report.min_edge_m, std::sqrt(8), 1e-14);
  EXPECT_NEAR(report.volume_m3, 8.0 / 3, 1e-14);
}

TEST(MeasureTets, CountsPartsAndTheirVolumes) {
  TetMesh mesh = GroupedBlock();
  const TetReport report = MeasureTets(mesh);
  EXPECT_EQ(report.nodes, 5 * 3 * 3);
  EXPECT_EQ(report.tetrahedra, 5 * 16);
  EXPECT_EQ(report.components, 1);
  EXPECT_NEAR(report.volume_m3, 2, 1e-13);
  EXPECT_NEAR(report.label_m3.at(7), 1, 1e-13);
  EXPECT_NEAR(report.group_m3.at("9"), 1, 1e-13);
  EXPECT_NEAR(report.min_edge_m, 0.5, 1e-15);
  // At the corner of a cube, and across its cut corner.
  EXPECT_NEAR(report.max_dihedral_deg, 90, 1e-9);
  EXPECT_NEAR(report.min_dihedral_deg, std::acos(1 / std::sqrt(3.0)) * 180 / M_PI, 1e-9);
}

// The bound against the highest frequency of a small block, from its whole stiffness matrix.
TEST(StableStep, IsJustBelowTheTrueBound) {
  const TetMesh mesh = MakeTetBlock({0.04, 0.02, 0.02}, 4).value();
  const TissueMaterial material{5000, 0.4, 1000};
  const double mu = 5000 / 2.8, lambda = 5000 * 0.4 / (1.4 * 0.2);
  const int n = static_cast<int>(mesh.surface.vertices.size());
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(3 * n);
  for (const Tetrahedron& t : mesh.tetrahedra) {
    const double volume = TetVolume(mesh.surface.vertices, t);
    Mat3 edges;
    for (int k = 0; k < 3; ++k) {
      edges.col(k) = mesh.surface.vertices[t[k + 1]] - mesh.surface.vertices[t[0]];
    }
    const Mat3 inverse = edges.inverse();
    std::array<Vec3, 4> g;
    g[0].setZero();
    for (int k = 0; k < 3; ++k) g[k + 1] = inverse.row(k).transpose(), g[0] -= g[k + 1];
    for (int i = 0; i < 4; ++i) {
      mass.segment<3>(3 * t[i]).array() += 1000 * volume / 4;
      for (int j = 0; j < 4; ++j) {
        stiffness.block<3, 3>(3 * t[i], 3 * t[j]) +=
            volume * (lambda * g[i] * g[j].transpose() + mu * g[j] * g[i].transpose() +
                      mu * g[i].dot(g[j]) * Mat3::Identity());
      }
    }
  }
  const Eigen::VectorXd scale = mass.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * stiffness * scale.asDiagonal();
  const double w =
      std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled).eigenvalues().maxCoeff());
  const double step_s = StableStep(mesh, material);
  EXPECT_LT(step_s, 2 / w);
  EXPECT_GT(step_s, 0.6 * 2 / w);  // on the safe side, but not by much
  // Waves: a mesh of half the size, or of four times the stiffness, halves the step.
  EXPECT_NEAR(StableStep(mesh, {20000, 0.4, 1000}), step_s / 2, 1e-12 * step_s);
  EXPECT_NEAR(StableStep(MakeTetBlock({0.02, 0.01, 0.01}, 4).value(), material), step_s / 2,
              1e-12 * step_s);
}

}  // namespace
}  // namespace adhesim
