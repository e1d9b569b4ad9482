#include "core/scene/mesh/read_tet_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "core/scene/build_model.h"
#include "tests/scene_mesh/files.h"
#include "tests/scene_mesh/tet_files.h"

namespace adhesim {
namespace {

// The places of a tetrahedron's corners, whatever their order.
std::multiset<std::string> Places(const TetMesh& mesh) {
  std::multiset<std::string> places;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    std::set<std::string> corners;
    for (const int node : mesh.tetrahedra[t]) {
      const Vec3& p = mesh.surface.vertices[node];
      corners.insert(std::to_string(p.x()) + " " + std::to_string(p.y()) + " " +
                     std::to_string(p.z()));
    }
    std::string text = std::to_string(mesh.label[t]) + ":";
    for (const std::string& corner : corners) text += corner + ", ";
    places.insert(text);
  }
  return places;
}

TEST(ReadTetMesh, GivesTheSameMeshFromEveryDialect) {
  const TetMesh original = GroupedBlock();
  for (const auto& [name, bytes] : InEveryTetFormat()) {
    SCOPED_TRACE(name);
    const TemporaryFile file(name, bytes);
    const absl::StatusOr<TetMesh> mesh = ReadTetMesh(file.path());
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    // The file has the surface's nodes first already: the order stays.
    EXPECT_EQ(mesh->surface.vertices, original.surface.vertices);
    EXPECT_EQ(mesh->surface.triangles.size(), original.surface.triangles.size());
    EXPECT_EQ(Places(*mesh), Places(original));
    EXPECT_EQ(mesh->fill, std::vector<double>(original.tetrahedra.size(), 1.0));
    EXPECT_NEAR(FilledVolume(*mesh), 2, 1e-14);  // those the wrong way round were turned
    ASSERT_EQ(mesh->warnings.size(), 1u);
    EXPECT_NE(mesh->warnings[0].find("1 of the file's"), std::string::npos);
    if (name.find("vtk") != std::string::npos) continue;
    for (std::size_t t = 0; t < mesh->tetrahedra.size(); ++t) {
      EXPECT_EQ(mesh->group_names[mesh->group[t]], mesh->label[t] == 7 ? "left" : "9");
    }
    ASSERT_EQ(mesh->node_groups.size(), 1u);
    EXPECT_EQ(mesh->node_groups[0].name, "base");
    EXPECT_EQ(mesh->node_groups[0].nodes.size(), 5u * 3u);
    for (const int node : mesh->node_groups[0].nodes) {
      EXPECT_EQ(mesh->surface.vertices[node].z(), -0.5);
    }
  }
}

TEST(ReadTetMesh, MakesABodyWhoseRegionsHaveNames) {
  const TemporaryFile file("block.msh", InEveryTetFormat().at("text4.msh"));
  v1::Scene scene;
  v1::Body* body = scene.add_bodies();
  body->set_name("block");
  body->mutable_tet_mesh()->set_file("block.msh");
  body->mutable_tet_mesh()->set_scale_m(0.01);
  body->set_density_kg_m3(1000);
  body->add_fixed()->set_group("base");
  const auto fixed_count = [&] {
    const BuiltModel built = BuildModel(scene, file.directory());
    if (built.model == nullptr) return -1;
    const auto& fixed = built.model->fixed;
    return static_cast<int>(std::count(fixed.begin(), fixed.end(), 1));
  };
  EXPECT_EQ(fixed_count(), 15);
  body->mutable_fixed(0)->set_group("left");
  EXPECT_EQ(fixed_count(), 27);  // 3 x 3 x 3 nodes
  body->mutable_fixed(0)->set_label(9);
  EXPECT_EQ(fixed_count(), 27);
  const BuiltModel built = BuildModel(scene, file.directory());
  ASSERT_NE(built.model, nullptr);
  EXPECT_EQ(built.problems.size(), 1u);  // the warning
  EXPECT_EQ(built.model->group_names, (std::vector<std::string>{"left", "9"}));
  double mass_kg = 0;
  for (const double m : built.model->mass_kg) mass_kg += m;
  EXPECT_NEAR(mass_kg, 2e-6 * 1000, 1e-15);
  EXPECT_EQ(built.model->bodies[0].tetrahedron_count, 5 * 16);
  body->mutable_fixed(0)->set_group("right");
  const BuiltModel refused = BuildModel(scene, file.directory());
  EXPECT_EQ(refused.model, nullptr);
  EXPECT_EQ(refused.problems.back().path, "bodies[0].fixed[0]");
  EXPECT_NE(refused.problems.back().message.find("its groups are left, 9, base"), std::string::npos)
      << refused.problems.back().message;
  body->mutable_tet_mesh()->set_file("none.msh");
  EXPECT_EQ(BuildModel(scene, file.directory()).problems[0].path, "bodies[0].tet_mesh.file");
}

std::string Gmsh(const std::string& nodes, const std::string& elements) {
  return "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" + nodes + "$EndNodes\n$Elements\n" +
         elements + "$EndElements\n";
}
constexpr char kFiveNodes[] = "5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n";

std::string ErrorOf(const absl::StatusOr<TetMesh>& mesh) {
  return mesh.ok() ? "read" : std::string(mesh.status().message());
}

TEST(ReadTetMesh, NamesWhatIsWrongInGmshFiles) {
  const auto error = [](const std::string& elements) {
    return ErrorOf(ParseGmsh(Gmsh(kFiveNodes, elements)));
  };
  EXPECT_EQ(error("1\n1 4 0 1 2 3 4\n"), "read");
  EXPECT_EQ(error("1\n1 4 0 1 2 3 9\n"), "line 14: element 1: there is no node 9");
  EXPECT_EQ(error("1\n8 4 0 1 2 3 3\n"),
            "line 14: element 8: a tetrahedron without volume (0); permitted: above 2.82843e-12, "
            "1e-12 of its longest edge cubed");
  EXPECT_EQ(error("2\n1 4 0 1 2 3 4\n6 4 0 4 2 3 1\n"),
            "line 15: element 6: has the same nodes as element 1; remove it");
  EXPECT_NE(error("3\n1 4 0 1 2 3 4\n2 4 0 1 2 3 5\n3 4 0 2 1 3 5\n").find("same nodes"),
            std::string::npos);
  EXPECT_NE(
      error("1\n1 11 0 1 2 3 4 5 1 2 3 4 5\n").find("line 14: type 11 is an element of higher"),
      std::string::npos);
  EXPECT_NE(error("1\n1 5 0 1 2 3 4 5 1 2 3\n").find("a hexahedron; permitted: 4 (tetrahedron)"),
            std::string::npos);
  EXPECT_NE(error("1\n1 2 0 1 2 3\n").find("no tetrahedra in this file"), std::string::npos);
  EXPECT_NE(error("2\n1 4 0 1 2 3 4\n").find("not a (finite) number"), std::string::npos);
  EXPECT_NE(error("99999999999\n").find("not possible in the "), std::string::npos);
  EXPECT_NE(error("1\n1 4 0 1 2 3 4\n5 4\n").find("expected $EndElements"), std::string::npos);
  const auto nodes = [](const std::string& text) {
    return ErrorOf(ParseGmsh(Gmsh(text, "1\n1 4 0 1 2 3 4\n")));
  };
  EXPECT_EQ(nodes("2\n1 0 0 0\n1 0 0 1\n"), "line 7: a second node 1");
  EXPECT_NE(nodes("1\n1 0 0 nan\n").find("line 6: the data ends here"), std::string::npos);
  EXPECT_NE(ErrorOf(ParseGmsh("$MeshFormat\n1 0 8\n")).find("permitted: 2.2 and 4.1"),
            std::string::npos);
  EXPECT_NE(ErrorOf(ParseGmsh("$NOD\n")).find("begins with $MeshFormat"), std::string::npos);
  EXPECT_NE(ErrorOf(ParseGmsh("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n")).find("no $Nodes"),
            std::string::npos);
}

TEST(ReadTetMesh, RefusesThreeTetrahedraAtAFace) {
  const std::string error =
      ErrorOf(ParseGmsh(Gmsh("6\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n6 0 0 -1\n",
                             "3\n1 4 0 1 2 3 4\n2 4 0 1 2 3 5\n3 4 0 1 2 3 6\n")));
  EXPECT_EQ(error,
            "line 17: element 3: shares a face with elements 1 and 2; at most two tetrahedra can "
            "meet at a "
            "face");
}

TEST(ReadTetMesh, NamesWhatIsWrongInVtkFiles) {
  const auto error = [](const std::string& after_points) {
    return ErrorOf(
        ParseVtk("# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n"
                 "0 0 0\n1 0 0\n0 1 0\n0 0 1\n" +
                 after_points));
  };
  EXPECT_EQ(error("CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n"), "read");
  EXPECT_EQ(error("CELLS 1 5\n4 0 1 2 4\nCELL_TYPES 1\n10\n"),
            "line 11: element 0: names node 4 (counted from 0); permitted: 0 to 3");
  EXPECT_NE(error("CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n24\n")
                .find("line 11: cell 0 (counted from 0): type 24; permitted: 10"),
            std::string::npos);
  EXPECT_NE(error("CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n10\n")
                .find("a tetrahedron of 3 corners; permitted: 4"),
            std::string::npos);
  EXPECT_NE(error("CELLS 1 4\n4 0 1 2 3\n").find("announces 4 numbers"), std::string::npos);
  EXPECT_NE(error("CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 2\n10 10\n").find("1 cells and 2 cell types"),
            std::string::npos);
  EXPECT_NE(error("LINES 1 5\n").find("'LINES' is not a section that is read"), std::string::npos);
  EXPECT_NE(error("").find("no CELLS"), std::string::npos);
  EXPECT_NE(ErrorOf(ParseVtk("# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n"))
                .find("permitted: DATASET UNSTRUCTURED_GRID"),
            std::string::npos);
  EXPECT_NE(ErrorOf(ParseVtk("<?xml?>")).find("begins with '# vtk"), std::string::npos);
}

// Six atoms, of which the last is unused; two tetrahedra in components of their own, the second the
// wrong way round; a face and a list of atoms with names; a neighbourhood.
std::string PmlOfTwo(const std::string& second) {
  std::string atoms;
  const char* at[] = {"0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 1 1", "9 9 9"};
  for (int i = 0; i < 6; ++i) {
    const std::string xyz = at[i];
    atoms += "<atom><atomProperties index='" + std::to_string(10 * i) + "' x='" + xyz[0] + "' y='" +
             xyz[2] + "' z='" + xyz[4] + "'/></atom>";
  }
  const auto cell = [](const std::string& type, const std::vector<int>& corners) {
    std::string text = "<cell><cellProperties type='" + type + "'/>";
    for (const int c : corners) text += "<atomRef index='" + std::to_string(c) + "'/>";
    return text + "</cell>";
  };
  const auto component = [](const std::string& name, const std::string& inside) {
    return "<structuralComponent name='" + name + "'>" + inside + "</structuralComponent>";
  };
  return "<physicalModel><atoms>" + component("", atoms) +
         "</atoms><exclusiveComponents><multiComponent>" +
         component("left", cell("TETRAHEDRON", {0, 10, 20, 30})) + component("right", second) +
         "</multiComponent></exclusiveComponents><informativeComponents><multiComponent>" +
         component("base", cell("TRIANGLE", {0, 20, 10})) +
         component("pins", "<atomRef index='30'/><atomRef index='50'/>") +
         component("Neighborhoods", cell("POLY_VERTEX", {0, 10, 20})) +
         "</multiComponent></informativeComponents></physicalModel>";
}

TEST(ReadTetMesh, TakesTheTetrahedraOfPmlFilesWithTheirComponentsAsGroups) {
  const std::string second =
      "<cell><cellProperties index='7' type='TETRAHEDRON'/><atomRef index='10'/><atomRef "
      "index='20'/><atomRef index='30'/><atomRef index='40'/></cell>";
  const TemporaryFile file("two.pml", PmlOfTwo(second));
  const absl::StatusOr<TetMesh> mesh = ReadTetMesh(file.path());
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->surface.vertices.size(), 5u);
  EXPECT_EQ(mesh->surface.triangles.size(), 6u);
  EXPECT_NEAR(FilledVolume(*mesh), 1.0 / 6 + 1.0 / 3, 1e-15);
  EXPECT_EQ(mesh->group_names, (std::vector<std::string>{"left", "right"}));
  EXPECT_EQ(mesh->group, (std::vector<std::int32_t>{0, 1}));
  ASSERT_EQ(mesh->node_groups.size(), 2u);
  EXPECT_EQ(mesh->node_groups[0].name, "base");
  EXPECT_EQ(mesh->node_groups[0].nodes, (std::vector<std::int32_t>{0, 1, 2}));
  EXPECT_EQ(mesh->node_groups[1].name, "pins");
  EXPECT_EQ(mesh->node_groups[1].nodes, (std::vector<std::int32_t>{3}));
  ASSERT_EQ(mesh->warnings.size(), 1u);  // of the unused atom

  const auto error = [](const std::string& cells) {
    const TemporaryFile wrong("wrong.pml", PmlOfTwo(cells));
    return ErrorOf(ReadTetMesh(wrong.path()));
  };
  const std::string flat =
      "<cell><cellProperties index='7' type='TETRAHEDRON'/><atomRef index='10'/><atomRef "
      "index='20'/><atomRef index='10'/><atomRef index='40'/></cell>";
  EXPECT_NE(error(flat).find("element 7: a tetrahedron without volume"), std::string::npos)
      << error(flat);
  std::string wedge = "<cell><cellProperties index='8' type='WEDGE'/>";
  for (const int atom : {0, 10, 20, 30, 40, 50}) {
    wedge += "<atomRef index='" + std::to_string(atom) + "'/>";
  }
  EXPECT_NE(error(wedge + "</cell>").find("cell 8 of component 'right' is a WEDGE; permitted"),
            std::string::npos)
      << error(wedge + "</cell>");
}

TEST(ReadTetMesh, IsChosenByTheFilesName) {
  EXPECT_TRUE(IsTetMeshName("a/B.MSH"));
  EXPECT_TRUE(IsTetMeshName("b.vtk"));
  EXPECT_FALSE(IsTetMeshName("b.obj"));
  EXPECT_NE(ErrorOf(ReadTetMesh("x.obj")).find(".msh, .pml and .vtk"), std::string::npos);
}

}  // namespace
}  // namespace adhesim
