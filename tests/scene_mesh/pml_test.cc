#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>

#include "core/scene/build_model.h"
#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/generate.h"
#include "core/scene/mesh/pml_surface.h"
#include "core/scene/mesh/read_mesh.h"
#include "core/scene/mesh/read_pml.h"
#include "core/scene/mesh/write_pml.h"
#include "tests/scene_mesh/files.h"

namespace adhesim {
namespace {

std::string Sample() {
  std::ifstream file(ADHESIM_SOURCE_DIR "/tests/scene_mesh/sample.pml");
  return std::string(std::istreambuf_iterator<char>(file), {});
}

PmlModel SampleModel() {
  const absl::StatusOr<PmlModel> model = ParsePml(Sample());
  EXPECT_TRUE(model.ok()) << model.status();
  return model.value_or(PmlModel{});
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

void ExpectRefused(const std::string& bytes, const std::string& part) {
  const absl::StatusOr<PmlModel> model = ParsePml(bytes);
  ASSERT_FALSE(model.ok()) << part;
  const std::string message(model.status().message());
  EXPECT_NE(message.find(part), std::string::npos) << message;
}

// The sample with one place changed is refused with a message that holds `part`.
void ExpectChangeRefused(const std::string& from, const std::string& to, const std::string& part) {
  ExpectRefused(Replaced(Sample(), from, to), part);
}

void ExpectSameBits(const PmlModel& a, const PmlModel& b) {
  EXPECT_TRUE(a == b);
  ASSERT_EQ(a.atoms.size(), b.atoms.size());
  for (std::size_t i = 0; i < a.atoms.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(std::bit_cast<std::uint64_t>(a.atoms[i].position[axis]),
                std::bit_cast<std::uint64_t>(b.atoms[i].position[axis]));
    }
  }
}

TEST(Pml, ReadsEveryElementOfTheSubset) {
  const PmlModel model = SampleModel();
  EXPECT_EQ(model.name, "pyramid & co");
  EXPECT_EQ(model.properties, (PmlProperties{{"author", "nobody"}}));
  EXPECT_EQ(model.atom_list.color.size(), 4u);
  ASSERT_EQ(model.atoms.size(), 17u);
  EXPECT_EQ(model.atoms[1].index, 10);
  EXPECT_EQ(model.atoms[1].name, "corner");
  EXPECT_EQ(model.atoms[1].properties, (PmlProperties{{"mass", "0.25"}, {"fixed", "true"}}));
  EXPECT_EQ(model.atoms[3].position, Vec3(1, 1, 0));

  ASSERT_TRUE(model.exclusive && model.informative);
  EXPECT_EQ(model.exclusive->properties, (PmlProperties{{"note", "kept"}}));
  ASSERT_EQ(model.exclusive->components.size(), 1u);
  const PmlComponent& bodies = model.exclusive->components[0];
  EXPECT_TRUE(bodies.multi);
  ASSERT_EQ(bodies.components.size(), 5u);
  const PmlComponent& skin = bodies.components[2];
  EXPECT_EQ(skin.name, "skin");
  EXPECT_EQ(skin.properties.size(), 2u);
  const PmlCell& base = model.cells[skin.cells[0]];
  EXPECT_EQ(base.type, PmlCellType::kQuad);
  EXPECT_EQ(base.name, "base");
  EXPECT_EQ(base.properties, (PmlProperties{{"stiff", "yes"}}));
  EXPECT_EQ(base.color[3], (std::pair<std::string, std::string>{"a", "0.5"}));
  EXPECT_EQ(base.atoms, (std::vector<std::int32_t>{1, 0, 3, 2}));  // 10, 13, 12, 11

  const auto& informative = model.informative->components;
  ASSERT_EQ(informative.size(), 3u);
  EXPECT_EQ(model.cells[informative[0].cells[0]].atoms.size(), 5u);
  EXPECT_EQ(informative[1].atoms, (std::vector<std::int32_t>{1, 2}));
  EXPECT_EQ(informative[2].cells, (std::vector<std::int32_t>{skin.cells[1], skin.cells[2]}));
}

TEST(Pml, WritesWhatItReads) {
  const PmlModel model = SampleModel();
  const absl::StatusOr<std::string> text = WritePml(model);
  ASSERT_TRUE(text.ok()) << text.status();
  const absl::StatusOr<PmlModel> again = ParsePml(*text);
  ASSERT_TRUE(again.ok()) << again.status();
  ExpectSameBits(*again, model);
  EXPECT_EQ(*WritePml(*again), *text);
  // What it writes into the counts is right, whatever the file it read said.
  EXPECT_NE(text->find("nrOfAtoms=\"17\" nrOfExclusiveComponents=\"1\" "
                       "nrOfInformativeComponents=\"3\" nrOfCells=\"14\""),
            std::string::npos);
}

TEST(Pml, KeepsEveryBitOfACoordinate) {
  PmlModel model;
  std::mt19937_64 random(1);
  for (int i = 0; i < 1000; ++i) {
    Vec3 position;
    for (double& coordinate : position) {
      do {
        coordinate = std::bit_cast<double>(random());
      } while (!std::isfinite(coordinate));
    }
    model.atoms.push_back({i, position, "", {}});
  }
  model.atoms.push_back({1000, Vec3(-0.0, 5e-324, std::numeric_limits<double>::max()), "", {}});
  const absl::StatusOr<std::string> text = WritePml(model);
  ASSERT_TRUE(text.ok());
  const absl::StatusOr<PmlModel> again = ParsePml(*text);
  ASSERT_TRUE(again.ok()) << again.status();
  ExpectSameBits(*again, model);
}

TEST(Pml, KeepsEveryCharacterOfANameOrRefusesIt) {
  PmlModel model;
  model.name = "<\"Zell'\" & \t\n\r größe>";
  model.properties = {{"note", " two  blanks "}};
  const absl::StatusOr<std::string> text = WritePml(model);
  ASSERT_TRUE(text.ok());
  const absl::StatusOr<PmlModel> again = ParsePml(*text);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(*again == model);

  model.name = "bell\a";
  EXPECT_FALSE(WritePml(model).ok());
}

TEST(Pml, RefusesToWriteASharedCellWithoutIndex) {
  PmlModel model = SampleModel();
  model.cells[model.informative->components[2].cells[0]].index.reset();
  EXPECT_FALSE(WritePml(model).ok());
}

TEST(Pml, TakesTheFirstExclusiveComponentWithASurface) {
  const PmlModel model = SampleModel();
  const absl::StatusOr<TriangleMesh> skin = PmlSurface(model, "");
  ASSERT_TRUE(skin.ok()) << skin.status();
  // The five atoms of the pyramid in the file's order; the quad cut from its first corner.
  ASSERT_EQ(skin->vertices.size(), 5u);
  EXPECT_EQ(skin->vertices[0], Vec3(0, 1, 0));
  EXPECT_EQ(
      skin->triangles,
      (std::vector<Triangle>{{1, 0, 3}, {1, 3, 2}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {0, 1, 4}}));
  const MeshCheck check = CheckMesh(*skin);
  EXPECT_TRUE(check.flaws.empty());
  // A third of base times height; the few operations err by some 1e-17.
  EXPECT_NEAR(check.report.volume_m3, 0.1 / 3, 1e-15);
  EXPECT_EQ(PmlSurface(model, "skin")->triangles, skin->triangles);
}

TEST(Pml, TurnsTheOutsideOfVolumeCellsIntoASurface) {
  const PmlModel model = SampleModel();
  // The cube and the wedge share one face: of 11 faces 9 are outside, 7 of them quads.
  const absl::StatusOr<TriangleMesh> solid = PmlSurface(model, "solid");
  ASSERT_TRUE(solid.ok()) << solid.status();
  const MeshReport report = CheckMesh(*solid).report;
  EXPECT_EQ(report.vertices, 10);
  EXPECT_EQ(report.triangles, 16);
  EXPECT_TRUE(report.closed && report.oriented);
  // 1 for the cube and 1/2 for the wedge, from coordinates that are whole numbers.
  EXPECT_NEAR(report.volume_m3, 1.5, 1e-14);

  // Four tetrahedra of either handedness around an edge.
  const absl::StatusOr<TriangleMesh> spire = PmlSurface(model, "spire");
  ASSERT_TRUE(spire.ok()) << spire.status();
  const MeshReport spire_report = CheckMesh(*spire).report;
  EXPECT_EQ(spire_report.triangles, 8);
  EXPECT_TRUE(spire_report.closed && spire_report.oriented);
  // A third of the base's area 1 times the heights' difference 1/2.
  EXPECT_NEAR(spire_report.volume_m3, 1.0 / 6, 1e-14);
}

TEST(Pml, FindsInformativeComponentsByName) {
  const absl::StatusOr<TriangleMesh> front = PmlSurface(SampleModel(), "front");
  ASSERT_TRUE(front.ok()) << front.status();
  EXPECT_EQ(front->triangles, (std::vector<Triangle>{{0, 1, 3}, {1, 2, 3}}));
}

TEST(Pml, SaysWhichComponentsThereAre) {
  const absl::StatusOr<TriangleMesh> none = PmlSurface(SampleModel(), "skim");
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.status().message(),
            "no structuralComponent of faces or volume cells is named 'skim'; there are: 'skin', "
            "'solid', 'spire', 'front'");
  EXPECT_FALSE(PmlSurface(SampleModel(), "thread").ok());
  PmlModel atoms_only = SampleModel();
  atoms_only.exclusive.reset();
  EXPECT_FALSE(PmlSurface(atoms_only, "").ok());
}

TEST(Pml, WritesASurfaceWithItsNeighbourhoods) {
  const TriangleMesh sphere = MakeIcosphere(0.1, 1);
  const PmlPart part{"ball", sphere.triangles};
  const absl::StatusOr<std::string> text =
      WritePml(PmlOfSurface("balls", sphere.vertices, {&part, 1}));
  ASSERT_TRUE(text.ok());
  const absl::StatusOr<PmlModel> model = ParsePml(*text);
  ASSERT_TRUE(model.ok()) << model.status();
  const absl::StatusOr<TriangleMesh> again = PmlSurface(*model, "ball");
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->vertices, sphere.vertices);
  EXPECT_EQ(again->triangles, sphere.triangles);

  // One neighbourhood per atom: itself first, and then 5 or 6 others; each edge is seen twice.
  const PmlComponent& neighbourhoods = model->informative->components[0];
  EXPECT_EQ(neighbourhoods.name, "Neighborhoods");
  ASSERT_EQ(neighbourhoods.cells.size(), sphere.vertices.size());
  std::size_t neighbours = 0;
  for (std::size_t i = 0; i < neighbourhoods.cells.size(); ++i) {
    const PmlCell& cell = model->cells[neighbourhoods.cells[i]];
    EXPECT_EQ(cell.type, PmlCellType::kPolyVertex);
    EXPECT_EQ(cell.atoms[0], static_cast<std::int32_t>(i));
    neighbours += cell.atoms.size() - 1;
  }
  EXPECT_EQ(neighbours, 2u * 120);
}

TEST(Pml, IsAMeshFileOfABody) {
  const TemporaryFile file("sample.pml", Sample());
  v1::Scene scene;
  v1::Body* body = scene.add_bodies();
  body->set_name("solid");
  body->set_mass_kg(1);
  body->mutable_mesh()->set_file("sample.pml");
  body->mutable_mesh()->set_scale_m(0.001);
  body->mutable_mesh()->set_component("solid");
  const BuiltModel built = BuildModel(scene, file.directory());
  ASSERT_NE(built.model, nullptr) << built.problems[0].message;
  EXPECT_EQ(built.model->particle_count(), 10);
  // 1.5 cubic millimetres, from coordinates of a few digits.
  EXPECT_NEAR(built.model->bodies[0].rest_volume_m3, 1.5e-9, 1e-22);

  body->mutable_mesh()->set_component("thread");
  const BuiltModel refused = BuildModel(scene, file.directory());
  ASSERT_EQ(refused.problems.size(), 1u);
  EXPECT_EQ(refused.problems[0].path, "bodies[0].mesh.file");
}

TEST(Pml, AloneHasComponents) {
  const TemporaryFile file("a.obj", WriteObj(MakeIcosphere(1, 0)));
  const absl::StatusOr<TriangleMesh> mesh = ReadMesh(file.path(), "skin");
  ASSERT_FALSE(mesh.ok());
  EXPECT_NE(mesh.status().message().find("only .pml files"), absl::string_view::npos);
}

TEST(Pml, NamesThePlaceOfWhatIsWrong) {
  ExpectChangeRefused("index=\"11\" x=\"1\"", "index=\"10\" x=\"1\"",
                      "line 10, column 7: a second atom of index 10");
  ExpectChangeRefused("x=\"3\"", "x=\"nan\"", "coordinate x 'nan' is not a finite number");
  ExpectChangeRefused("x=\"3\"", "x=\"1e999\"", "coordinate x '1e999'");
  ExpectChangeRefused("x=\"3\"", "", "an atom without x");
  ExpectChangeRefused("index=\"11\" x=\"1\"", "x=\"1\"", "an atom without index");
  ExpectChangeRefused("index=\"11\" x=\"1\"", "index=\"-1\" x=\"1\"", "whole number from 0 to");
  ExpectChangeRefused("nrOfAtoms=\"99\"", "nrOfAtoms=\"many\"", "nrOfAtoms 'many'");
  ExpectChangeRefused("<atomRef index=\"20\"/>", "<atomRef index=\"21\"/>", "there is no atom 21");
  ExpectChangeRefused("<atomRef index=\"20\"/>", "<atomRef/>", "an <atomRef> without index");
  ExpectChangeRefused("<cellRef index=\"2\"/>", "<cellRef index=\"9\"/>", "there is no cell 9");
  ExpectChangeRefused("index=\"7\" type", "index=\"3\" type", "a second cell of index 3");
  ExpectChangeRefused("type=\"TRIANGLE\"", "type=\"PYRAMID\"",
                      "a cell of type 'PYRAMID'; permitted: LINE, POLY_LINE");
  ExpectChangeRefused("type=\"TRIANGLE\"", "type=\"QUAD\"", "a QUAD of 3 atoms; it has 4");
  ExpectChangeRefused("type=\"LINE\"", "type=\"TRIANGLE\"", "a TRIANGLE of 2 atoms; it has 3");
  ExpectChangeRefused("<cellProperties type=\"LINE\"/>", "", "a <cell> without <cellProperties>");
  ExpectChangeRefused("<cellRef index=\"2\"/>", "<atomRef index=\"10\"/>", "either atoms or cells");
  ExpectChangeRefused("<atomRef index=\"11\"/>\n</structuralComponent>",
                      "<cellRef index=\"1\"/>\n</structuralComponent>", "either atoms or cells");
}

TEST(Pml, RefusesWhatTheSubsetDoesNotKnow) {
  ExpectChangeRefused("<structuralComponent name=\"empty\"/>", "<spring/>",
                      "element 'spring' is not in the subset");
  ExpectChangeRefused("<structuralComponent name=\"empty\"/>", "<atoms/>",
                      "<atoms> does not belong in multiComponent");
  ExpectChangeRefused("<cell><cellProperties type=\"LINE\"/>",
                      "<cell colour=\"red\"><cellProperties type=\"LINE\"/>",
                      "<cell> has no attribute 'colour'");
  ExpectChangeRefused("<structuralComponent name=\"empty\"/>", "some text", "the text 'some text'");
  ExpectChangeRefused("</exclusiveComponents>", "<multiComponent/></exclusiveComponents>",
                      "a second multiComponent in <exclusiveComponents>");
  ExpectChangeRefused("<color r=\"1\" g=\"0\" b=\"0\" a=\"1\"/>", "<color/>", "<color> without");
  ExpectRefused("<physicalModel/>", "a physicalModel without <atoms>");
  ExpectRefused("<physicalModel><exclusiveComponents/><atoms/></physicalModel>",
                "<exclusiveComponents> before <atoms>");
  ExpectRefused("<physicalModel><atoms/><atoms/></physicalModel>", "a second <atoms>");
  ExpectRefused("<physicalModel><atoms><structuralComponent><cell/></structuralComponent></atoms>",
                "<cell> does not belong in <atoms>");
  ExpectRefused("<scene/>", "element 'scene' is not in the subset");
}

TEST(Pml, RefusesWhatIsNotWellFormed) {
  ExpectRefused("", "not well-formed XML");
  ExpectRefused("solid x\n", "line 1, column 1: not well-formed XML");
  ExpectRefused(Sample().substr(0, 3000), "not well-formed XML");
  ExpectChangeRefused("</physicalModel>", "", "not well-formed XML");
  ExpectChangeRefused("</physicalModel>", "</physicalModel><physicalModel/>",
                      "not well-formed XML");
  ExpectChangeRefused("mass=\"0.25\"", "x=\"0\"", "not well-formed XML: duplicate attribute");
  ExpectChangeRefused("corner", "\xff", "not well-formed XML");
}

TEST(Pml, IsNotHarmedByEntitiesNestingOrPromises) {
  // Entities that would grow to 10^9 letters, or read a file of this machine.
  ExpectRefused(
      "<!DOCTYPE p [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;\">]>"
      "<physicalModel name=\"&b;\"/>",
      "line 1, column 13: a document type declaration");
  ExpectRefused("<!DOCTYPE p [<!ENTITY a SYSTEM \"file:///etc/passwd\">]><physicalModel>&a;",
                "a document type declaration");
  ExpectRefused("<!DOCTYPE physicalModel SYSTEM \"http://127.0.0.1/a.dtd\"><physicalModel/>",
                "a document type declaration");
  ExpectChangeRefused("corner", "&unknown;", "not well-formed XML: undefined entity");

  std::string deep = "<physicalModel><atoms/><exclusiveComponents>";
  for (int i = 0; i < 1'000'000; ++i) deep += "<multiComponent>";
  ExpectRefused(deep, "elements nested deeper than 64");

  // A count reserves nothing.
  const std::string promising =
      "<physicalModel nrOfAtoms=\"2147483647\"><atoms><structuralComponent>"
      "<nrOfStructures value=\"2147483647\"/></structuralComponent></atoms></physicalModel>";
  EXPECT_TRUE(ParsePml(promising).ok());
  ExpectRefused(Replaced(promising, "2147483647", "99999999999999999999"), "whole number");
}

}  // namespace
}  // namespace adhesim
