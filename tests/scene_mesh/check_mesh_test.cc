#include "core/scene/mesh/check_mesh.h"

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/scene/mesh/generate.h"

namespace adhesim {
namespace {

// The mesh has exactly this one flaw.
void ExpectFlaw(const TriangleMesh& mesh, const std::string& part, bool warning = false) {
  const MeshCheck check = CheckMesh(mesh);
  ASSERT_EQ(check.flaws.size(), 1u) << (check.flaws.size() > 1 ? check.flaws[1].message : "");
  EXPECT_NE(check.flaws[0].message.find(part), std::string::npos) << check.flaws[0].message;
  EXPECT_EQ(check.flaws[0].warning, warning);
}

// Appends a second mesh, moved.
TriangleMesh Joined(TriangleMesh a, const TriangleMesh& b, const Vec3& move) {
  const int offset = static_cast<int>(a.vertices.size());
  for (const Vec3& v : b.vertices) a.vertices.push_back(v + move);
  for (const auto [i, j, k] : b.triangles) {
    a.triangles.push_back({i + offset, j + offset, k + offset});
  }
  return a;
}

TriangleMesh Reversed(TriangleMesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  return mesh;
}

TEST(CheckMesh, MeasuresACube) {
  const MeshReport r = CheckMesh(MakeBlock({2, 2, 2}, 1)).report;
  EXPECT_EQ(r.vertices, 8);
  EXPECT_EQ(r.triangles, 12);
  EXPECT_EQ(r.edges, 18);
  EXPECT_EQ(r.components, 1);
  EXPECT_EQ(r.euler_characteristic, 2);
  EXPECT_EQ(r.genus, 0);
  EXPECT_EQ(r.min_edge_m, 2);
  EXPECT_EQ(r.area_m2, 24);
  EXPECT_EQ(r.volume_m3, 8);
  EXPECT_EQ(r.max_edge_m, std::sqrt(8.0));
  EXPECT_NEAR(r.min_angle_deg, 45, 1e-12);  // acos at 45 degrees: a few roundings
}

TEST(CheckMesh, CountsTheHandleOfATorus) {
  TriangleMesh torus;  // 6 x 4 vertices
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 4; ++j) {
      const double u = i * 3.14159265358979 / 3, v = j * 3.14159265358979 / 2;
      torus.vertices.emplace_back((2 + std::cos(v)) * std::cos(u), (2 + std::cos(v)) * std::sin(u),
                                  std::sin(v));
      const auto at = [](int a, int b) { return a % 6 * 4 + b % 4; };
      torus.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      torus.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  const MeshCheck check = CheckMesh(torus);
  EXPECT_TRUE(check.flaws.empty());
  EXPECT_EQ(check.report.genus, 1);
}

TEST(CheckMesh, RefusesAMeshWithoutTriangles) {
  ExpectFlaw({}, "no triangles");
  ExpectFlaw({{Vec3::Zero()}, {}}, "no triangles");
}

TEST(CheckMesh, NamesVerticesThatAreNotNumbers) {
  TriangleMesh mesh = MakeIcosphere(1, 1);
  mesh.vertices[17].y() = std::numeric_limits<double>::quiet_NaN();
  ExpectFlaw(mesh, "vertex 17 ");
  for (int i = 20; i < 30; ++i) mesh.vertices[i].x() = std::numeric_limits<double>::infinity();
  ExpectFlaw(mesh, "vertices 17, 20, 21 and 8 more");
}

TEST(CheckMesh, NamesIndicesOutOfRange) {
  TriangleMesh mesh = MakeIcosphere(1, 0);
  mesh.triangles[3][1] = 12;
  ExpectFlaw(mesh, "triangle 3 ");
  mesh.triangles[3][1] = -1;
  ExpectFlaw(mesh, "triangle 3 ");
}

TEST(CheckMesh, NamesDegenerateTriangles) {
  TriangleMesh repeated = MakeSheet(1, 1, 3, 3);
  repeated.triangles.push_back({4, 4, 5});
  ExpectFlaw(repeated, "degenerate triangle 8 ");
  TriangleMesh flat;  // three points on a line, with different numbers
  flat.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {1, 1, 0}};
  flat.triangles = {{0, 1, 3}, {1, 2, 3}, {0, 2, 1}};
  ExpectFlaw(flat, "degenerate triangle 2 ");
  TriangleMesh point = MakeIcosphere(1, 1);
  for (Vec3& v : point.vertices) v.setZero();
  ExpectFlaw(point, "degenerate triangles 0, 1, 2 and 77 more");
}

TEST(CheckMesh, KeepsThinTrianglesThatAFileInSinglePrecisionCanMean) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0.5, 1e-7, 0}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_TRUE(CheckMesh(mesh).flaws.empty());
}

TEST(CheckMesh, NamesDuplicateTriangles) {
  TriangleMesh mesh = MakeIcosphere(1, 1);
  const auto [a, b, c] = mesh.triangles[5];
  mesh.triangles.push_back({b, c, a});
  ExpectFlaw(mesh, "duplicate triangle 80 ");
  mesh.triangles.back() = {b, a, c};  // also when it faces the other way
  ExpectFlaw(mesh, "duplicate triangle 80 ");
}

TEST(CheckMesh, NamesNonManifoldEdges) {
  TriangleMesh mesh = MakeIcosphere(1, 1);
  mesh.vertices.emplace_back(3, 0, 0);
  mesh.triangles.push_back({mesh.triangles[0][0], mesh.triangles[0][1], 42});
  const int a = std::min(mesh.triangles[0][0], mesh.triangles[0][1]);
  const int b = std::max(mesh.triangles[0][0], mesh.triangles[0][1]);
  ExpectFlaw(mesh, absl::StrCat("non-manifold edge ", a, "-", b));
  EXPECT_FALSE(CheckMesh(mesh).report.manifold);
}

TEST(CheckMesh, NamesVerticesWhereSurfacesTouch) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 4}};
  ExpectFlaw(mesh, "non-manifold vertex 0 ");
}

TEST(CheckMesh, NamesTheTriangleThatIsFlipped) {
  TriangleMesh mesh = MakeIcosphere(1, 1);
  std::swap(mesh.triangles[33][0], mesh.triangles[33][1]);
  ExpectFlaw(mesh, "flipped winding: triangle 33 ");
  std::swap(mesh.triangles[0][0], mesh.triangles[0][1]);  // also the one the walk begins at
  ExpectFlaw(mesh, "flipped winding: triangles 0, 33 ");
}

TEST(CheckMesh, RefusesAClosedSurfaceInsideOut) {
  ExpectFlaw(Reversed(MakeIcosphere(1, 1)), "inside out");
  EXPECT_TRUE(CheckMesh(Reversed(MakeSheet(1, 1, 3, 3))).flaws.empty());  // open: no inside
}

TEST(CheckMesh, RefusesAOneSidedSurface) {
  TriangleMesh strip;  // a Moebius strip of 5 vertices
  for (int i = 0; i < 5; ++i) {
    strip.vertices.emplace_back(std::cos(i * 1.2566), std::sin(i * 1.2566), 0.3 * (i % 3));
    strip.triangles.push_back({i, (i + 1) % 5, (i + 2) % 5});
  }
  ExpectFlaw(strip, "one side only");
}

TEST(CheckMesh, NamesUnusedVertices) {
  TriangleMesh mesh = MakeIcosphere(1, 1);
  mesh.vertices.emplace_back(0, 0, 0);
  ExpectFlaw(mesh, "unused vertex 42 ");
}

TEST(CheckMesh, WarnsOfSeparatePieces) {
  const TriangleMesh two = Joined(MakeIcosphere(1, 1), MakeIcosphere(1, 1), {3, 0, 0});
  ExpectFlaw(two, "2 separate pieces", /*warning=*/true);
  EXPECT_EQ(CheckMesh(two).report.components, 2);
  EXPECT_EQ(CheckMesh(two).report.genus, 0);
}

TEST(CheckMesh, PermitsACavityButNoPieceInsideOutOutside) {
  const TriangleMesh shell = Joined(MakeIcosphere(2, 2), Reversed(MakeIcosphere(1, 1)), {0, 0, 0});
  ExpectFlaw(shell, "2 separate pieces", /*warning=*/true);
  const TriangleMesh wrong = Joined(MakeIcosphere(2, 2), Reversed(MakeIcosphere(1, 1)), {5, 0, 0});
  const MeshCheck check = CheckMesh(wrong);
  ASSERT_EQ(check.flaws.size(), 2u);  // the warning of two pieces, and the error
  EXPECT_NE(check.flaws[1].message.find("inside out"), std::string::npos);
}

TEST(CheckMesh, RefusesASoupOfTriangles) {
  TriangleMesh soup;
  for (int i = 0; i < 2000; ++i) {
    soup = Joined(std::move(soup), {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}, Vec3(0, 0, i));
  }
  ExpectFlaw(soup, "merge vertices");
}

TEST(CheckMesh, SurvivesNumbersThatOverflow) {
  TriangleMesh mesh = MakeIcosphere(1, 1);
  for (Vec3& v : mesh.vertices) v *= 1e300;
  EXPECT_FALSE(CheckMesh(mesh).flaws.empty());
}

}  // namespace
}  // namespace adhesim
