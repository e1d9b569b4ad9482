// Files with wrong bytes: every reader must come back with a mesh or an error. Run under the
// asan-ubsan preset this also shows that none reads or writes out of bounds.

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>

#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/embed.h"
#include "core/scene/mesh/generate.h"
#include "core/scene/mesh/mesh_formats.h"
#include "core/scene/mesh/pml_surface.h"
#include "core/scene/mesh/read_pml.h"
#include "core/scene/mesh/read_tet_mesh.h"
#include "core/scene/mesh/write_pml.h"
#include "tests/scene_mesh/files.h"
#include "tests/scene_mesh/tet_files.h"

namespace adhesim {
namespace {

// Changes, removes, repeats or cuts a few bytes.
std::string Mutated(std::string bytes, std::mt19937* random) {
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : (*random)() % n; };
  for (int change = 0; change < 1 + static_cast<int>(below(4)); ++change) {
    const std::size_t at = below(bytes.size());
    switch (below(6)) {
      case 0:
        bytes[at] = static_cast<char>(below(256));
        break;
      case 1:
        bytes[at] = "0123456789-+.eE nfa/#\n"[below(22)];
        break;
      case 2:
        bytes.erase(at, below(8));
        break;
      case 3:
        bytes.insert(at, bytes.substr(below(bytes.size()), below(40)));
        break;
      case 4:
        bytes.resize(at + 1);
        break;
      default:
        bytes[below(std::min<std::size_t>(bytes.size(), 200))] ^= 1 << below(8);
        break;
    }
    if (bytes.empty()) bytes.push_back('x');
  }
  return bytes;
}

TEST(MutatedFiles, GiveAMeshOrAnError) {
  using Parser = absl::StatusOr<TriangleMesh> (*)(absl::string_view);
  const std::map<std::string, Parser> parsers = {
      {"obj", &ParseObj}, {"off", &ParseOff}, {"ply", &ParsePly}, {"stl", &ParseStl}};
  std::mt19937 random(1);
  int accepted = 0, refused = 0;
  for (const auto& [name, bytes] : InEveryFormat(MakeIcosphere(1, 0))) {
    const Parser parse = parsers.at(name.substr(name.find('.') + 1));
    for (int i = 0; i < 2000; ++i) {
      const auto mesh = parse(Mutated(bytes, &random));
      (mesh.ok() ? accepted : refused) += 1;
      if (mesh.ok()) CheckMesh(*mesh);  // must cope with whatever the reader lets through
    }
  }
  // The mutations are neither all harmless nor all fatal: both ways were walked.
  EXPECT_GT(accepted, 100);
  EXPECT_GT(refused, 100);
}

TEST(MutatedFiles, OfPmlGiveAModelThatCanBeWrittenOrAnError) {
  std::ifstream file(ADHESIM_SOURCE_DIR "/tests/scene_mesh/sample.pml");
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  std::mt19937 random(1);
  int accepted = 0, refused = 0;
  for (int i = 0; i < 2000; ++i) {
    const absl::StatusOr<PmlModel> model = ParsePml(Mutated(bytes, &random));
    (model.ok() ? accepted : refused) += 1;
    if (!model.ok()) continue;
    const absl::StatusOr<std::string> text = WritePml(*model);
    ASSERT_TRUE(text.ok()) << text.status();
    const absl::StatusOr<PmlModel> again = ParsePml(*text);
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_TRUE(*again == *model);
    for (const char* component : {"", "solid", "spire"}) {
      const absl::StatusOr<TriangleMesh> mesh = PmlSurface(*model, component);
      if (mesh.ok()) CheckMesh(*mesh);
    }
  }
  EXPECT_GT(accepted, 100);
  EXPECT_GT(refused, 100);
}

TEST(MutatedFiles, OfTetrahedraGiveASoundMeshOrAnError) {
  std::mt19937 random(1);
  int accepted = 0, refused = 0;
  for (const auto& [name, bytes] : InEveryTetFormat()) {
    const auto parse = name.ends_with(".msh") ? &ParseGmsh : &ParseVtk;
    for (int i = 0; i < 700; ++i) {
      const absl::StatusOr<TetMesh> mesh = parse(Mutated(bytes, &random));
      (mesh.ok() ? accepted : refused) += 1;
      if (!mesh.ok()) continue;
      for (const Tetrahedron& t : mesh->tetrahedra) {
        ASSERT_GT(TetVolume(mesh->surface.vertices, t), 0);
      }
      ASSERT_EQ(mesh->label.size(), mesh->tetrahedra.size());
      ASSERT_EQ(mesh->group.size(), mesh->tetrahedra.size());
    }
  }
  EXPECT_GT(accepted, 100);
  EXPECT_GT(refused, 100);
}

// Whatever comes out of a damaged surface can be embedded or is refused.
TEST(MutatedFiles, OfSurfacesAreEmbeddedOrRefused) {
  std::mt19937 random(2);
  const std::string bytes = InEveryFormat(MakeIcosphere(1, 1)).at("text.off");
  int embedded = 0;
  for (int i = 0; i < 300; ++i) {
    const absl::StatusOr<TriangleMesh> surface = ParseOff(Mutated(bytes, &random));
    if (!surface.ok()) continue;
    const absl::StatusOr<TetMesh> mesh = EmbedInLattice(*surface, 3);
    if (!mesh.ok()) continue;
    ++embedded;
    EXPECT_GT(FilledVolume(*mesh), 0);
    EXPECT_EQ(mesh->fill.size(), mesh->tetrahedra.size());
  }
  EXPECT_GT(embedded, 20);
}

}  // namespace
}  // namespace adhesim
