// Surfaces of every kind in a lattice of tetrahedra that carries them.

#include "core/scene/mesh/embed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "core/scene/build_model.h"
#include "core/scene/mesh/generate.h"
#include "core/scene/mesh/topology.h"
#include "core/scene/mesh/winding_number.h"
#include "tests/scene_mesh/files.h"
#include "tests/support/scene_of_text.h"
#include "tests/support/test_size.h"

namespace adhesim {
namespace {

using test::SceneOfText;
// Subdivisions of spheres, and a quarter of the cells across.
constexpr int kFine = kSanitized ? 2 : 3;

TriangleMesh Reversed(TriangleMesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

TriangleMesh Moved(TriangleMesh mesh, const Vec3& by) {
  for (Vec3& v : mesh.vertices) v += by;
  return mesh;
}

TriangleMesh Both(TriangleMesh a, const TriangleMesh& b) {
  const auto first = static_cast<std::int32_t>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles) {
    a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  return a;
}

// Without the part above a height: a hole.
TriangleMesh OpenAbove(const TriangleMesh& mesh, double z) {
  TriangleMesh open{mesh.vertices, {}};
  for (const Triangle& t : mesh.triangles) {
    if (std::min({mesh.vertices[t[0]].z(), mesh.vertices[t[1]].z(), mesh.vertices[t[2]].z()}) < z) {
      open.triangles.push_back(t);
    }
  }
  return open;
}

// Every triangle with vertices of its own.
TriangleMesh Soup(const TriangleMesh& mesh) {
  TriangleMesh soup;
  for (const Triangle& t : mesh.triangles) {
    const auto first = static_cast<std::int32_t>(soup.vertices.size());
    for (const std::int32_t v : t) soup.vertices.push_back(mesh.vertices[v]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  return soup;
}

std::size_t VertexCount(const TetMesh& mesh) { return mesh.carried.size(); }

// What holds for every embedded surface.
void ExpectSound(const TetMesh& mesh) {
  const std::vector<Vec3>& nodes = mesh.surface.vertices;
  std::vector<double> volume(nodes.size(), 0);
  ASSERT_EQ(mesh.fill.size(), mesh.tetrahedra.size());
  ASSERT_EQ(mesh.label.size(), mesh.tetrahedra.size());
  ASSERT_EQ(mesh.group.size(), mesh.tetrahedra.size());
  Aabb box;
  for (std::size_t v = 0; v < VertexCount(mesh); ++v) box.Add(nodes[v]);
  const double size = (box.max - box.min).norm();
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    EXPECT_GT(TetVolume(nodes, mesh.tetrahedra[t]), 0);
    EXPECT_GE(mesh.fill[t], kLeastFill);
    EXPECT_LE(mesh.fill[t], 1);
    for (const std::int32_t node : mesh.tetrahedra[t]) {
      ASSERT_GE(node, static_cast<std::int32_t>(VertexCount(mesh)));
      volume[node] += mesh.fill[t] * TetVolume(nodes, mesh.tetrahedra[t]) / 4;
    }
  }
  for (std::size_t n = VertexCount(mesh); n < nodes.size(); ++n) EXPECT_GT(volume[n], 0);
  for (std::size_t v = 0; v < mesh.carried.size(); ++v) {
    const CarriedParticle& c = mesh.carried[v];
    EXPECT_EQ(c.particle, static_cast<std::int32_t>(v));
    Vec3 position = Vec3::Zero();
    double sum = 0;
    for (int k = 0; k < 4; ++k) {
      ASSERT_GT(volume[c.carriers[k]], 0);
      position += c.weights[k] * nodes[c.carriers[k]];
      sum += c.weights[k];
      EXPECT_GT(c.weights[k], -0.51);  // at most half a height outside
    }
    // Roundings of numbers near 1 and near the size.
    EXPECT_NEAR(sum, 1, 1e-14);
    EXPECT_LT((position - nodes[v]).norm(), 1e-12 * size);
  }
}

TetMesh Embedded(const TriangleMesh& surface, int cells) {
  absl::StatusOr<TetMesh> mesh = EmbedInLattice(surface, cells);
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  if (!mesh.ok()) return {};
  ExpectSound(*mesh);
  return *std::move(mesh);
}

// Sum over triangles of area times cosine to the outside of a ball about a point, over the area.
double MeanOutwardness(const TetMesh& mesh, const Vec3& centre) {
  double outward = 0, area_m2 = 0;
  for (const auto [a, b, c] : mesh.surface.triangles) {
    const auto& v = mesh.surface.vertices;
    const Vec3 area = AreaVector(v[a], v[b], v[c]);
    outward += area.dot(((v[a] + v[b] + v[c]) / 3 - centre).normalized());
    area_m2 += area.norm();
  }
  return outward / area_m2;
}

TEST(WindingNumber, IsTheFullSumToFourHundredths) {
  const TriangleMesh sphere = OpenAbove(MakeIcosphere(1, 4), 0.7);
  const WindingNumber winding(sphere);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.3, 1.3);
  for (int i = 0; i < 300; ++i) {
    const Vec3 p(uniform(random), uniform(random), uniform(random));
    double sum = 0;
    for (const auto [ia, ib, ic] : sphere.triangles) {
      const Vec3 a = sphere.vertices[ia] - p, b = sphere.vertices[ib] - p,
                 c = sphere.vertices[ic] - p;
      const double la = a.norm(), lb = b.norm(), lc = c.norm();
      sum += 2 * std::atan2(a.dot(b.cross(c)),
                            la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    EXPECT_NEAR(winding.At(p), sum / (4 * std::numbers::pi), 0.04);
  }
}

TEST(Embed, FillsASphereEverMoreExactly) {
  const TriangleMesh sphere = MakeIcosphere(0.05, 3);
  const double volume_m3 = EnclosedVolume(sphere);
  // The volume is a count of samples: its error falls faster than the size of the cells, but not
  // evenly, so that the bounds are ones that 1.5th order with a margin keeps.
  for (const int cells : {4, 8, 16}) {
    if (kSanitized && cells > 8) break;
    const TetMesh mesh = Embedded(sphere, cells);
    const double error = std::abs(FilledVolume(mesh) / volume_m3 - 1);
    RecordProperty("cells_" + std::to_string(cells), std::to_string(error));
    EXPECT_LT(error, 0.02 * std::pow(4.0 / cells, 1.5));
    EXPECT_EQ(mesh.surface.triangles, sphere.triangles);
    EXPECT_TRUE(mesh.warnings.empty());
  }
}

TEST(Embed, KeepsTheSurfacesNumbersAndTurnsItOutward) {
  const TriangleMesh sphere = MakeIcosphere(0.05, 2);
  const TetMesh mesh = Embedded(Reversed(sphere), 6);
  ASSERT_EQ(VertexCount(mesh), sphere.vertices.size());
  for (std::size_t v = 0; v < sphere.vertices.size(); ++v) {
    EXPECT_EQ(mesh.surface.vertices[v], sphere.vertices[v]);
  }
  EXPECT_GT(MeanOutwardness(mesh, Vec3::Zero()), 0.95);
  EXPECT_NEAR(FilledVolume(mesh), FilledVolume(Embedded(sphere, 6)), 1e-15);
  EXPECT_FALSE(mesh.warnings.empty());
  // Some triangles turned: a common flaw of files.
  TriangleMesh some = sphere;
  for (std::size_t t = 0; t < some.triangles.size(); t += 7) {
    std::swap(some.triangles[t][0], some.triangles[t][1]);
  }
  const TetMesh mended = Embedded(some, 6);
  EXPECT_GT(MeanOutwardness(mended, Vec3::Zero()), 0.95);
  EXPECT_NEAR(FilledVolume(mended), FilledVolume(mesh), 1e-15);
}

TEST(Embed, ClosesHoles) {
  const TriangleMesh sphere = MakeIcosphere(0.05, 3);
  const double whole_m3 = FilledVolume(Embedded(sphere, 8));
  const TriangleMesh open = OpenAbove(sphere, 0.04);
  EXPECT_LT(open.triangles.size(), sphere.triangles.size());
  const TetMesh mesh = Embedded(open, 8);
  // The missing cap is h^2 (3 R - h) pi / 3 = 2.8 % of the ball; the winding number closes the hole
  // somewhere within it.
  EXPECT_LT(FilledVolume(mesh), 1.01 * whole_m3);
  EXPECT_GT(FilledVolume(mesh), 0.95 * whole_m3);
  EXPECT_GT(MeanOutwardness(mesh, Vec3::Zero()), 0.95);
}

TEST(Embed, FillsOverlapsOnce) {
  const TriangleMesh ball = MakeIcosphere(0.05, kFine);
  const double apart = 0.05;
  const TetMesh mesh = Embedded(Both(ball, Moved(ball, {apart, 0, 0})), 4 * kFine);
  // Two balls of radius R at a distance R share 5 pi R^3 / 12, 5/16 of a ball.
  const double expected = EnclosedVolume(ball) * (2 - 5.0 / 16);
  EXPECT_NEAR(FilledVolume(mesh), expected, 0.02 * expected);
}

TEST(Embed, LeavesCavitiesEmptyAndTurnsDisjointPiecesByThemselves) {
  const TriangleMesh ball = MakeIcosphere(0.05, kFine), small = MakeIcosphere(0.03, kFine);
  const TetMesh hollow = Embedded(Both(ball, Reversed(small)), 4 * kFine);
  const double expected = EnclosedVolume(ball) - EnclosedVolume(small);
  EXPECT_NEAR(FilledVolume(hollow), expected, 0.02 * expected);
  EXPECT_EQ(hollow.surface.triangles, Both(ball, Reversed(small)).triangles);
  const TriangleMesh pair = Both(ball, Moved(ball, {0.2, 0, 0}));
  const TetMesh turned = Embedded(Both(ball, Reversed(Moved(ball, {0.2, 0, 0}))), 4 * kFine);
  EXPECT_EQ(turned.surface.triangles.size(), pair.triangles.size());
  EXPECT_NEAR(EnclosedVolume({turned.surface.vertices, turned.surface.triangles}),
              2 * EnclosedVolume(ball), 1e-12);
}

TEST(Embed, TakesASoupOfTriangles) {
  const TriangleMesh sphere = MakeIcosphere(0.05, 2);
  const TetMesh mesh = Embedded(Soup(sphere), 8);
  EXPECT_EQ(VertexCount(mesh), 3 * sphere.triangles.size());
  EXPECT_NEAR(FilledVolume(mesh), EnclosedVolume(sphere), 0.02 * EnclosedVolume(sphere));
}

TEST(Embed, LeavesOutWhatIsNoTriangleAndSaysSo) {
  TriangleMesh sphere = MakeIcosphere(0.05, 2);
  sphere.vertices.emplace_back(1, 1, 1);
  sphere.triangles.push_back({0, 0, 1});
  sphere.triangles.push_back(sphere.triangles[3]);
  const TetMesh mesh = Embedded(sphere, 6);
  EXPECT_EQ(VertexCount(mesh), 162u);
  EXPECT_EQ(mesh.surface.triangles.size(), 320u);
  EXPECT_EQ(mesh.warnings.size(), 3u);
}

// A thing much thinner than the cells stays in one piece, of a stiffness.
TEST(Embed, CarriesThinShapes) {
  const TriangleMesh plate = MakeBlock({0.1, 0.1, 0.0005}, 20);
  const TetMesh mesh = Embedded(Moved(plate, {0.003, 0.001, 0.0002}), 5);
  EXPECT_EQ(VertexCount(mesh), plate.vertices.size());
  ASSERT_EQ(mesh.warnings.size(), 1u);
  EXPECT_NE(mesh.warnings[0].find("thin for 5 cells"), std::string::npos);
  TriangleMesh rod = MakeBlock({0.1, 0.001, 0.001}, 40);
  for (Vec3& v : rod.vertices) v.y() += 8 * v.x() * v.x();  // bent
  for (Vec3& v : rod.vertices) v.z() += v.x() / 2;
  const TetMesh bent = Embedded(rod, 10);
  // All tetrahedra hang together by faces.
  std::vector<int> parent(bent.tetrahedra.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  const std::vector<TetFace> faces = SortedFaces(bent.tetrahedra);
  for (std::size_t f = 1; f < faces.size(); ++f) {
    if (faces[f].sorted != faces[f - 1].sorted) continue;
    parent[root(faces[f].tetrahedron)] = root(faces[f - 1].tetrahedron);
  }
  int pieces = 0;
  for (std::size_t i = 0; i < parent.size(); ++i) pieces += parent[i] == static_cast<int>(i);
  EXPECT_EQ(pieces, 1);
}

TEST(Embed, WorksForEveryNumberOfCells) {
  const TriangleMesh ball = Moved(MakeIcosphere(0.05, 1), {10, -3, 0.01});
  for (int cells = 1; cells <= (kSanitized ? 5 : 9); ++cells) Embedded(ball, cells);
}

TEST(Embed, RefusesWhatEnclosesNothing) {
  EXPECT_FALSE(EmbedInLattice({}, 5).ok());
  EXPECT_NE(EmbedInLattice(MakeSheet(1, 1, 4, 4), 5).status().message().find("encloses nothing"),
            std::string::npos);
  TriangleMesh broken = MakeIcosphere(1, 1);
  broken.vertices[3].x() = std::nan("");
  EXPECT_NE(EmbedInLattice(broken, 5).status().message().find("not finite"), std::string::npos);
  if (kSanitized) return;  // a lattice of 3 million cells, counted before it is refused
  const absl::Status large = EmbedInLattice(MakeBlock({1, 1, 1}, 1), 150).status();
  EXPECT_NE(large.message().find("at most 1000000"), std::string::npos) << large;
}

TEST(Embed, MakesABodyWhoseSurfaceIsCarried) {
  const v1::Scene scene = SceneOfText(R"(
    bodies { name: "a" icosphere { radius_m: 0.05 subdivisions: 3 } density_kg_m3: 1000
             tetrahedra { cells: 8 } velocity_m_s: [1, 2, 3]
             fixed { half_space { point_m: [0, 0, -0.02] normal: [0, 0, 1] } } }
    bodies { name: "b" icosphere { radius_m: 0.05 subdivisions: 4 } mass_kg: 3
             tetrahedra { cells: 3 } position_m: [1, 0, 0] rotation_deg: [30, 40, 50]
             fixed { ball { centre_m: [1, 0, 0.05] radius_m: 0.005 } } })");
  const BuiltModel built = BuildModel(scene, ".");
  for (const Problem& p : built.problems) ADD_FAILURE() << p.path << ": " << p.message;
  ASSERT_NE(built.model, nullptr);
  const Model& model = *built.model;
  const Body &a = model.bodies[0], &b = model.bodies[1];
  EXPECT_TRUE(a.closed);
  EXPECT_EQ(model.carried.size(), 642u + 2562u);
  const auto second = model.mass_kg.begin() + b.first_particle;
  // The ball's mass to the accuracy of its fill; the other's is written.
  EXPECT_NEAR(std::accumulate(model.mass_kg.begin(), second, 0.0), 1000 * a.rest_volume_m3,
              0.01 * 1000 * a.rest_volume_m3);
  EXPECT_NEAR(std::accumulate(second, model.mass_kg.end(), 0.0), 3, 1e-12);
  std::vector<std::uint8_t> is_carried(model.particle_count(), 0);
  for (const CarriedParticle& c : model.carried) {
    is_carried[c.particle] = 1;
    EXPECT_EQ(model.mass_kg[c.particle], 0);
    Vec3 position = Vec3::Zero();
    bool all_fixed = true;
    for (int k = 0; k < 4; ++k) {
      position += c.weights[k] * model.rest_position_m[c.carriers[k]];
      all_fixed = all_fixed && model.fixed[c.carriers[k]];
      EXPECT_GT(model.mass_kg[c.carriers[k]], 0);
    }
    EXPECT_LT((position - model.rest_position_m[c.particle]).norm(), 1e-13);
    EXPECT_EQ(model.fixed[c.particle] == 1, all_fixed);
  }
  EXPECT_TRUE(std::is_sorted(
      model.carried.begin(), model.carried.end(),
      [](const CarriedParticle& p, const CarriedParticle& q) { return p.particle < q.particle; }));
  for (int i = 0; i < model.particle_count(); ++i) {
    if (is_carried[i]) continue;
    EXPECT_EQ(model.area_m2[i], 0);
    if (i < b.first_particle) {
      EXPECT_EQ(model.fixed[i] == 1, model.rest_position_m[i].z() <= -0.02);
    }
  }
  // The small ball holds vertices but no node: what carries them is fixed.
  int fixed = 0;
  for (int i = b.first_particle; i < model.particle_count(); ++i) {
    if (is_carried[i] || !model.fixed[i]) continue;
    ++fixed;
    EXPECT_GT((model.rest_position_m[i] - Vec3(1, 0, 0.05)).norm(), 0.005);
  }
  EXPECT_GE(fixed, 4);
}

// Two labels in a generated image: 3 x 2 x 2 cm, the right third another tissue.
TEST(Embed, KnowsTheTissueOfALabelMap) {
  std::string bytes =
      "NRRD0004\ntype: ushort\ndimension: 3\nsizes: 38 28 28\nspacings: 1 1 1\nendian: big\n"
      "encoding: raw\n\n";
  for (int z = 0; z < 28; ++z) {
    for (int y = 0; y < 28; ++y) {
      for (int x = 0; x < 38; ++x) {
        const bool in = x >= 4 && x < 34 && y >= 4 && y < 24 && z >= 4 && z < 24;
        const int label = !in ? 0 : x < 24 ? 300 : 7;
        bytes += static_cast<char>(label >> 8);
        bytes += static_cast<char>(label & 255);
      }
    }
  }
  const TemporaryFile file("two.nrrd", bytes);
  v1::Scene scene;
  v1::Body* body = scene.add_bodies();
  body->set_name("organ");
  body->mutable_label_map()->set_file("two.nrrd");
  body->mutable_label_map()->set_particles(600);
  body->mutable_tetrahedra()->set_cells(15);
  body->set_density_kg_m3(1000);
  body->add_fixed()->set_label(7);
  const BuiltModel built = BuildModel(scene, file.directory());
  for (const Problem& p : built.problems) ADD_FAILURE() << p.path << ": " << p.message;
  ASSERT_NE(built.model, nullptr);
  const Model& model = *built.model;
  double volume_300 = 0, volume_7 = 0;
  for (std::size_t t = 0; t < model.tetrahedra.size(); ++t) {
    const double filled = model.fill[t] * TetVolume(model.rest_position_m, model.tetrahedra[t]);
    ASSERT_TRUE(model.tet_label[t] == 300 || model.tet_label[t] == 7) << model.tet_label[t];
    (model.tet_label[t] == 7 ? volume_7 : volume_300) += filled;
  }
  // 8 and 4 cm^3; a tetrahedron of 2 mm belongs to one tissue as a whole, and the surface is smooth
  // where the image has edges.
  EXPECT_NEAR(volume_300, 8e-6, 0.05 * 8e-6);
  EXPECT_NEAR(volume_7, 4e-6, 0.05 * 4e-6);
  // Fixed are the nodes of label 7: at the right of the border, or within a cell of it. The centre
  // of volume, 19 mm in the image, is the origin.
  for (int i = 0; i < model.particle_count(); ++i) {
    if (model.mass_kg[i] > 0) {
      const double x_m = model.rest_position_m[i].x();
      EXPECT_TRUE(x_m < 0.0075 || model.fixed[i]);
      EXPECT_TRUE(x_m > 0.0025 || !model.fixed[i]);
    }
  }
}

// The segmented liver: 1605 ml of parenchyma (255), 160 ml of vessels (127), 9 ml of lesion (85).
TEST(Embed, KnowsTheTissuesOfTheRealLiver) {
  v1::Scene scene;
  v1::Body* body = scene.add_bodies();
  body->set_name("liver");
  body->mutable_label_map()->set_file("asset:liver.inr.gz");
  body->mutable_tetrahedra()->set_cells(24);
  body->set_density_kg_m3(1060);
  const BuiltModel built = BuildModel(scene, ADHESIM_SOURCE_DIR);
  if (built.model == nullptr && !built.problems.empty() &&
      built.problems[0].message.find("not installed") != std::string::npos) {
    GTEST_SKIP() << built.problems[0].message;
  }
  ASSERT_NE(built.model, nullptr);
  const Model& model = *built.model;
  std::map<int, double> volume_ml;
  double sum_ml = 0;
  for (std::size_t t = 0; t < model.tetrahedra.size(); ++t) {
    const double ml = 1e6 * model.fill[t] * TetVolume(model.rest_position_m, model.tetrahedra[t]);
    volume_ml[model.tet_label[t]] += ml;
    sum_ml += ml;
  }
  // The whole is that of the closed surface, to the accuracy of the fill. Vessels are thinner than
  // the cells of 9 mm, so that the majority takes much of them.
  EXPECT_NEAR(sum_ml, 1e6 * model.bodies[0].rest_volume_m3, 0.01 * sum_ml);
  EXPECT_NEAR(volume_ml[255], 1605, 0.08 * 1605);
  EXPECT_GT(volume_ml[127], 40);
  EXPECT_NEAR(volume_ml[85], 9, 5);
  EXPECT_EQ(volume_ml.count(-1), 0u);
}

TEST(Embed, GivesTheSameBitsEachTime) {
  const TriangleMesh open = OpenAbove(MakeIcosphere(0.05, kFine), 0.03);
  const TetMesh a = Embedded(open, 7), b = Embedded(open, 7);
  EXPECT_EQ(a.surface.vertices, b.surface.vertices);
  EXPECT_EQ(a.fill, b.fill);
}

}  // namespace
}  // namespace adhesim
