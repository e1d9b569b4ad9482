#include "tests/scene_mesh/tet_files.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <sstream>
#include <utility>
#include <vector>

#include "core/scene/mesh/lattice.h"

namespace adhesim {
namespace {

// Writes numbers as words or as bytes.
class Writer {
 public:
  Writer(bool binary, bool big_endian) : binary_(binary), big_endian_(big_endian) {
    text_.precision(17);
  }
  Writer& Text(const std::string& text) {
    text_ << text;
    return *this;
  }
  template <typename T>
  Writer& Number(T value) {
    if (!binary_) {
      text_ << value << " ";
      return *this;
    }
    auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
    if (big_endian_) std::reverse(raw.begin(), raw.end());
    text_.write(raw.data(), raw.size());
    return *this;
  }
  Writer& Int(std::int64_t value) { return Number(static_cast<std::int32_t>(value)); }
  Writer& Size(std::int64_t value) { return Number(value); }
  Writer& Line() { return binary_ ? *this : Text("\n"); }
  std::string bytes() const { return text_.str(); }
  bool binary() const { return binary_; }

 private:
  bool binary_, big_endian_;
  std::ostringstream text_;
};

constexpr int kFirstTag = 11;  // of nodes: not their numbers
constexpr char kNames[] = "$PhysicalNames\n2\n3 7 \"left\"\n2 3 \"base\"\n$EndPhysicalNames\n";

std::vector<Vec3> Nodes(const TetMesh& mesh) {
  std::vector<Vec3> nodes = mesh.surface.vertices;
  nodes.emplace_back(9, 9, 9);  // unused
  return nodes;
}

// Every third one mirrored.
Tetrahedron Written(const TetMesh& mesh, std::size_t t) {
  Tetrahedron tetrahedron = mesh.tetrahedra[t];
  if (t % 3 == 0) std::swap(tetrahedron[0], tetrahedron[1]);
  return tetrahedron;
}

std::vector<Triangle> BaseTriangles(const TetMesh& mesh) {
  std::vector<Triangle> base;
  for (const Triangle& t : mesh.surface.triangles) {
    double top = -1;
    for (const int v : t) top = std::max(top, mesh.surface.vertices[v].z());
    if (top < -0.49) base.push_back(t);
  }
  return base;
}

std::string WriteGmsh2(const TetMesh& mesh, bool binary, bool big_endian) {
  Writer out(binary, big_endian);
  out.Text(binary ? "$MeshFormat\n2.2 1 8\n" : "$MeshFormat\n2.2 0 8\n");
  if (binary) out.Int(1).Text("\n");
  out.Text("$EndMeshFormat\n$Comments\nmade by a test\n$EndComments\n").Text(kNames);
  const std::vector<Vec3> nodes = Nodes(mesh);
  out.Text("$Nodes\n" + std::to_string(nodes.size()) + "\n");
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    out.Int(kFirstTag + n).Number(nodes[n].x()).Number(nodes[n].y()).Number(nodes[n].z()).Line();
  }
  const std::vector<Triangle> base = BaseTriangles(mesh);
  const std::size_t count = base.size() + mesh.tetrahedra.size();
  out.Text("$EndNodes\n$Elements\n" + std::to_string(count) + "\n");
  std::int64_t number = 0;
  if (binary) out.Int(2).Int(base.size()).Int(2);
  for (const Triangle& t : base) {
    out.Int(++number);
    if (!binary) out.Int(2).Int(2);
    out.Int(3).Int(1);
    for (const int v : t) out.Int(kFirstTag + v);
    out.Line();
  }
  if (binary) out.Int(4).Int(mesh.tetrahedra.size()).Int(2);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    out.Int(++number);
    if (!binary) out.Int(4).Int(2);
    out.Int(mesh.label[t]).Int(1);
    for (const int v : Written(mesh, t)) out.Int(kFirstTag + v);
    out.Line();
  }
  return out.Text("$EndElements\n").bytes();
}

std::string WriteGmsh4(const TetMesh& mesh, bool binary, bool big_endian) {
  Writer out(binary, big_endian);
  out.Text(binary ? "$MeshFormat\n4.1 1 8\n" : "$MeshFormat\n4.1 0 8\n");
  if (binary) out.Int(1).Text("\n");
  out.Text("$EndMeshFormat\n").Text(kNames).Text("$Entities\n");
  out.Size(1).Size(1).Size(1).Size(2).Line();
  const auto corner = [&](int count) {
    for (int k = 0; k < count; ++k) out.Number(0.5);
  };
  out.Int(1);
  corner(3);
  out.Size(0).Line();  // a point
  out.Int(1);
  corner(6);
  out.Size(0).Size(2).Int(1).Int(-1).Line();  // a curve
  out.Int(4);
  corner(6);
  out.Size(1).Int(3).Size(1).Int(1).Line();  // the base
  for (const int volume : {1, 2}) {
    out.Int(volume);
    corner(6);
    out.Size(1).Int(volume == 1 ? 7 : 9).Size(1).Int(4).Line();
  }
  out.Text("$EndEntities\n$Nodes\n");
  // Two blocks, the first with parameters.
  const std::vector<Vec3> nodes = Nodes(mesh);
  const std::size_t first = nodes.size() / 2;
  out.Size(2).Size(nodes.size()).Size(kFirstTag).Size(kFirstTag + nodes.size() - 1).Line();
  const auto block = [&](std::size_t begin, std::size_t end, int dimension, int parametric) {
    out.Int(dimension).Int(1).Int(parametric).Size(end - begin).Line();
    for (std::size_t n = begin; n < end; ++n) out.Size(kFirstTag + n).Line();
    for (std::size_t n = begin; n < end; ++n) {
      for (int axis = 0; axis < 3; ++axis) out.Number(nodes[n][axis]);
      for (int k = 0; k < dimension * parametric; ++k) out.Number(0.25);
      out.Line();
    }
  };
  block(0, first, 2, 1);
  block(first, nodes.size(), 3, 0);
  out.Text("$EndNodes\n$Elements\n");
  const std::vector<Triangle> base = BaseTriangles(mesh);
  const std::size_t count = base.size() + mesh.tetrahedra.size();
  out.Size(3).Size(count).Size(1).Size(count).Line();
  std::int64_t number = 0;
  out.Int(2).Int(4).Int(2).Size(base.size()).Line();
  for (const Triangle& t : base) {
    out.Size(++number);
    for (const int v : t) out.Size(kFirstTag + v);
    out.Line();
  }
  for (const int volume : {1, 2}) {
    const int label = volume == 1 ? 7 : 9;
    out.Int(3).Int(volume).Int(4);
    out.Size(std::count(mesh.label.begin(), mesh.label.end(), label)).Line();
    for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
      if (mesh.label[t] != label) continue;
      out.Size(++number);
      for (const int v : Written(mesh, t)) out.Size(kFirstTag + v);
      out.Line();
    }
  }
  return out.Text("$EndElements\n").bytes();
}

std::string WriteVtk(const TetMesh& mesh, bool binary, int version) {
  Writer out(binary, /*big_endian=*/true);
  out.Text("# vtk DataFile Version " + std::to_string(version) + ".1\nmade by a test\n");
  out.Text(binary ? "BINARY\n" : "ASCII\n").Text("DATASET UNSTRUCTURED_GRID\n");
  const std::vector<Vec3> nodes = Nodes(mesh);
  out.Text("POINTS " + std::to_string(nodes.size()) + " double\n");
  for (const Vec3& n : nodes) out.Number(n.x()).Number(n.y()).Number(n.z()).Line();
  // A triangle first, so that cells and tetrahedra have different numbers.
  const std::size_t cells = mesh.tetrahedra.size() + 1;
  if (version < 5) {
    out.Text("\nCELLS " + std::to_string(cells) + " " + std::to_string(5 * cells - 1) + "\n");
    out.Int(3).Int(0).Int(1).Int(2).Line();
    for (std::size_t t = 0; t + 1 < cells; ++t) {
      out.Int(4);
      for (const int v : Written(mesh, t)) out.Int(v);
      out.Line();
    }
  } else {
    out.Text("METADATA\nINFORMATION 0\n\nCELLS " + std::to_string(cells + 1) + " " +
             std::to_string(4 * cells - 1) + "\nOFFSETS vtktypeint64\n");
    out.Size(0);
    for (std::size_t c = 0; c < cells; ++c) out.Size(3 + 4 * c);
    out.Text("\nCONNECTIVITY vtktypeint64\n").Size(0).Size(1).Size(2);
    for (std::size_t t = 0; t + 1 < cells; ++t) {
      for (const int v : Written(mesh, t)) out.Size(v);
    }
  }
  out.Text("\nCELL_TYPES " + std::to_string(cells) + "\n").Int(5);
  for (std::size_t t = 0; t + 1 < cells; ++t) out.Int(10);
  out.Text("\nPOINT_DATA " + std::to_string(nodes.size()) + "\nVECTORS push float\n");
  for (std::size_t n = 0; n < 3 * nodes.size(); ++n) out.Number(0.5f);
  out.Text("\nCELL_DATA " + std::to_string(cells) + "\n");
  if (version < 5) {
    out.Text("SCALARS quality double 1\nLOOKUP_TABLE default\n");
    for (std::size_t c = 0; c < cells; ++c) out.Number(0.75);
    out.Text("\nSCALARS tissue int\nLOOKUP_TABLE default\n").Int(0);
    for (const int label : mesh.label) out.Int(label);
  } else {
    out.Text("FIELD FieldData 2\nquality 1 " + std::to_string(cells) + " double\n");
    for (std::size_t c = 0; c < cells; ++c) out.Number(0.75);
    out.Text("\ntissue 1 " + std::to_string(cells) + " vtktypeint64\n").Size(0);
    for (const int label : mesh.label) out.Size(label);
  }
  return out.Text("\n").bytes();
}

}  // namespace

TetMesh GroupedBlock() {
  TetMesh mesh = MakeTetBlock({2, 1, 1}, 4).value();
  mesh.group_names = {"left", "9"};
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    double x = 0;
    for (const int node : mesh.tetrahedra[t]) x += mesh.surface.vertices[node].x();
    mesh.label[t] = x < 0 ? 7 : 9;
    mesh.group[t] = x < 0 ? 0 : 1;
  }
  return mesh;
}

std::map<std::string, std::string> InEveryTetFormat() {
  const TetMesh mesh = GroupedBlock();
  return {{"text2.msh", WriteGmsh2(mesh, false, false)},
          {"little2.msh", WriteGmsh2(mesh, true, false)},
          {"big2.msh", WriteGmsh2(mesh, true, true)},
          {"text4.msh", WriteGmsh4(mesh, false, false)},
          {"little4.msh", WriteGmsh4(mesh, true, false)},
          {"big4.msh", WriteGmsh4(mesh, true, true)},
          {"text4.vtk", WriteVtk(mesh, false, 4)},
          {"binary4.vtk", WriteVtk(mesh, true, 4)},
          {"text5.vtk", WriteVtk(mesh, false, 5)},
          {"binary5.vtk", WriteVtk(mesh, true, 5)}};
}

}  // namespace adhesim
