#include "core/scene/mesh/read_mesh.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstdint>
#include <filesystem>
#include <limits>

#include "core/scene/build_model.h"
#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/generate.h"
#include "tests/scene_mesh/files.h"

namespace adhesim {
namespace {

void ExpectSameMesh(const TriangleMesh& a, const TriangleMesh& b) {
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.triangles, b.triangles);
}

// The file is refused with a message that names it and holds `part`.
void ExpectRefused(const std::string& name, const std::string& bytes, const std::string& part) {
  const TemporaryFile file(name, bytes);
  const auto mesh = ReadMesh(file.path());
  ASSERT_FALSE(mesh.ok()) << name << ": " << bytes;
  const std::string message(mesh.status().message());
  EXPECT_NE(message.find(name), std::string::npos) << message;
  EXPECT_NE(message.find(part), std::string::npos) << message;
}

// A sphere whose coordinates survive single precision.
TriangleMesh SphereInFloats() {
  TriangleMesh mesh = MakeIcosphere(0.1, 1);
  for (Vec3& v : mesh.vertices) {
    for (double& coordinate : v) {
      // volatile: g++ 12 at -O3 drops some of these conversions in place (wrong code, gone at -O2).
      volatile float in_float = static_cast<float>(coordinate);
      coordinate = in_float;
    }
  }
  return mesh;
}

TEST(ReadMesh, ReadsWhatEachFormatWrites) {
  const TriangleMesh sphere = SphereInFloats();
  for (const auto& [name, bytes] : InEveryFormat(sphere)) {
    const TemporaryFile file(name, bytes);
    const auto mesh = ReadMesh(file.path());
    ASSERT_TRUE(mesh.ok()) << name << ": " << mesh.status();
    if (name.find("stl") == std::string::npos) {
      ExpectSameMesh(*mesh, sphere);
    } else {  // STL numbers vertices by first appearance
      EXPECT_EQ(mesh->vertices.size(), 42u) << name;
      const MeshCheck check = CheckMesh(*mesh);
      EXPECT_TRUE(check.flaws.empty()) << name;
      // The same triangles, but summed from another vertex: round-off of 80 terms of 1e-4.
      EXPECT_NEAR(check.report.volume_m3, CheckMesh(sphere).report.volume_m3, 1e-17);
    }
  }
}

TEST(ReadMesh, UnderstandsWhatObjFilesHold) {
  const TemporaryFile file("quad.OBJ", R"(# a quad and a triangle
mtllib none.mtl
o thing
v 0 0 0
v +1 0 0 1.0
v 1 1e0 0 0.5 0.5 0.5
v 0 1 0
vt 0 0
vn 0 0 1
s off
usemtl none
f 1/1/1 2/1/1 3/1/1 4/1/1
f -1//1 -2//1 5  # before its vertex
v 0 2 0
)");
  const auto mesh = ReadMesh(file.path());
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->vertices[1], Vec3(1, 0, 0));
  EXPECT_EQ(mesh->triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {3, 2, 4}}));
}

TEST(ReadMesh, UnderstandsWindowsLinesColoursAndPolygons) {
  const TemporaryFile file(
      "a.off",
      "COFF\r\n# comment\r\n4 1 0\r\n0 0 0 255 0 0 255\r\n1 0 0 255 0 0 255\r\n"
      "1 1 0 255 0 0 255\r\n0 1 0 255 0 0 255\r\n4 0 1 2 3 0.5 0.5 0.5\r\n");
  const auto mesh = ReadMesh(file.path());
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles.size(), 2u);
}

TEST(ReadMesh, RefusesFilesThatAreNotThereOrNotFiles) {
  EXPECT_EQ(ReadMesh("/nonexistent/a.obj").status().code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(ReadMesh("/dev/zero").ok());
  const TemporaryFile file("x.obj", "");
  std::filesystem::create_directory(file.directory() + "/d.obj");
  EXPECT_FALSE(ReadMesh(file.directory() + "/d.obj").ok());
}

TEST(ReadMesh, RefusesEmptyAndForeignFiles) {
  for (const std::string name : {"a.obj", "a.off", "a.ply", "a.stl"}) {
    ExpectRefused(name, "", "empty");
    ExpectRefused(name, "\x89PNG\r\n\x1a\n and so on", "");
  }
  ExpectRefused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles");
  ExpectRefused("a.off", "OFF\n0 0 0\n", "no triangles");
  ExpectRefused("a.stl", "solid x\nendsolid x\n", "no triangles");
  ExpectRefused("a.gltf", "{}", ".obj, .off, .ply, .pml and .stl");
}

TEST(ReadMesh, NamesTheLineOfABadObj) {
  ExpectRefused("a.obj", "v 0 0 0\nv nan 0 0\n", "line 2: coordinate 'nan'");
  ExpectRefused("a.obj", "v 0 0 0\nv 0 inf 0\n", "line 2: coordinate 'inf'");
  ExpectRefused("a.obj", "v 0 0 1e999\n", "line 1: coordinate");
  ExpectRefused("a.obj", "v 0 0\n", "line 1: a vertex needs three");
  ExpectRefused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4: a face names vertex 3");
  ExpectRefused("a.obj", "v 0 0 0\nf 1 1 -2\n", "line 2: a face names vertex -1");
  ExpectRefused("a.obj", "f 0 1 2\n", "line 1: a face's vertex");
  ExpectRefused("a.obj", "f 99999999999999999999 1 2\n", "line 1: a face's vertex");
  ExpectRefused("a.obj", "v 0 0 0\nf 1 1\n", "line 2: a face of 2 vertices");
}

TEST(ReadMesh, NamesTheLineOfABadOff) {
  ExpectRefused("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n", "line 5: coordinate 'x'");
  ExpectRefused("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "line 6: a face names");
  ExpectRefused("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n9 0 1 2\n", "line 6: a face is");
  ExpectRefused("a.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "after 1 of 2 faces");
  ExpectRefused("a.off", "OFF\n999999999999 1 0\n", "do not fit");
  ExpectRefused("a.off", "OFF BINARY\n", "not OFF BINARY");
}

TEST(ReadMesh, RefusesABadStl) {
  ExpectRefused("a.stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n",
                "ends before");
  ExpectRefused("a.stl", "solid x\nfacet normal 0 0 1\nvertex 0 0 0\nendfacet\nendsolid\n",
                "three vertices");
  ExpectRefused("a.stl", "solid x\nvertex 0 nan 0\nendsolid\n", "outside a facet");
  std::string binary = InEveryFormat(SphereInFloats()).at("binary.stl");
  ExpectRefused("a.stl", binary.substr(0, binary.size() - 10), "this one has");
  const auto nan = std::bit_cast<std::array<char, 4>>(std::numeric_limits<float>::quiet_NaN());
  binary.replace(84 + 50 * 7 + 12, 4, nan.data(), 4);
  ExpectRefused("a.stl", binary, "triangle 7 ");
}

TEST(ReadMesh, RefusesABadPly) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\nelement face 1\n";
  const std::string list = "property list uchar int vertex_index\nend_header\n";
  ExpectRefused("a.ply", head + list + "0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n", "vertex 2 ");
  ExpectRefused("a.ply", head + list + "0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "face 0 ");
  ExpectRefused("a.ply", head + list + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "data ends");
  ExpectRefused("a.ply", head + "end_header\n0 0 0\n1 0 0\n0 1 0\n", "");
  ExpectRefused("a.ply", head, "no end_header");
  ExpectRefused("a.ply", "ply\nformat binary_middle_endian 1.0\n", "line 2: the format");
  ExpectRefused("a.ply", "ply\nformat ascii 1.0\nelement vertex 4000000000\n", "not possible");
}

TEST(ReadMesh, TakesNoMoreMemoryThanAHostileFileHas) {
  // A list of 4294967295 numbers in a file of a hundred bytes.
  ExpectRefused("a.ply",
                "ply\nformat binary_little_endian 1.0\nelement face 1\n"
                "property list uint uchar vertex_index\nend_header\n\xff\xff\xff\xff\x01\x02",
                "data ends");
}

TEST(BuildModel, ReadsAMeshInItsOwnUnit) {
  const TemporaryFile file("cell.obj", InEveryFormat(SphereInFloats()).at("text.obj"));
  v1::Scene scene;
  v1::Body* body = scene.add_bodies();
  body->set_name("cell");
  body->set_mass_kg(1);
  body->mutable_mesh()->set_file("cell.obj");
  body->mutable_mesh()->set_scale_m(0.001);
  const BuiltModel built = BuildModel(scene, file.directory());
  ASSERT_NE(built.model, nullptr);
  // Float vertices of a sphere of 0.1 file units.
  EXPECT_NEAR(built.model->rest_position_m[0].norm(), 0.0001, 1e-11);
}

TEST(BuildModel, GivesOneProblemPerBadMesh) {
  const TriangleMesh sphere = SphereInFloats();
  TriangleMesh degenerate = sphere, duplicate = sphere, flipped = sphere, winged = sphere,
               unused = sphere;
  degenerate.triangles.push_back({3, 3, 4});
  duplicate.triangles.push_back(sphere.triangles[5]);
  std::swap(flipped.triangles[9][0], flipped.triangles[9][1]);
  winged.vertices.emplace_back(1, 0, 0);
  winged.triangles.push_back({sphere.triangles[0][0], sphere.triangles[0][1], 42});
  unused.vertices.emplace_back(1, 0, 0);
  const std::string good = InEveryFormat(sphere).at("text.obj");
  std::string with_nan = good;
  with_nan.replace(2, with_nan.find(' ', 2) - 2, "nan");
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"", "empty"},
      {with_nan, "line 1: coordinate 'nan'"},
      {WriteObj(degenerate), "degenerate triangle 80"},
      {WriteObj(duplicate), "duplicate triangle 80"},
      {WriteObj(flipped), "flipped winding: triangle 9"},
      {WriteObj(winged), "non-manifold edge"},
      {WriteObj(unused), "unused vertex 42"}};
  for (const auto& [bytes, part] : bad) {
    const TemporaryFile file("bad.obj", bytes);
    v1::Scene scene;
    v1::Body* body = scene.add_bodies();
    body->set_name("bad");
    body->set_mass_kg(1);
    body->mutable_mesh()->set_file("bad.obj");
    const BuiltModel built = BuildModel(scene, file.directory());
    EXPECT_EQ(built.model, nullptr);
    ASSERT_EQ(built.problems.size(), 1u) << part;
    EXPECT_EQ(built.problems[0].path, "bodies[0].mesh.file");
    EXPECT_NE(built.problems[0].message.find(part), std::string::npos) << built.problems[0].message;
    EXPECT_NE(built.problems[0].message.find("bad.obj"), std::string::npos);
  }
}

}  // namespace
}  // namespace adhesim
