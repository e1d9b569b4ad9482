#include "tests/scene_mesh/files.h"

#include <stdlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace adhesim {
namespace {

template <typename T>
void Append(T value, bool big_endian, std::string* bytes) {
  auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if (big_endian) std::reverse(raw.begin(), raw.end());
  bytes->append(raw.data(), raw.size());
}

std::ostringstream Text() {
  std::ostringstream text;
  text.precision(17);
  return text;
}

std::string WriteOff(const TriangleMesh& mesh) {
  std::ostringstream text = Text();
  text << "OFF\n" << mesh.vertices.size() << " " << mesh.triangles.size() << " 0\n";
  for (const Vec3& v : mesh.vertices) text << v.x() << " " << v.y() << " " << v.z() << "\n";
  for (const auto [a, b, c] : mesh.triangles) text << "3 " << a << " " << b << " " << c << "\n";
  return text.str();
}

std::string WriteTextStl(const TriangleMesh& mesh) {
  std::ostringstream text = Text();
  text << "solid test\n";
  for (const Triangle& t : mesh.triangles) {
    text << "facet normal 0 0 0\nouter loop\n";
    for (const int i : t) {
      const Vec3& v = mesh.vertices[i];
      text << "vertex " << v.x() << " " << v.y() << " " << v.z() << "\n";
    }
    text << "endloop\nendfacet\n";
  }
  text << "endsolid test\n";
  return text.str();
}

std::string WriteBinaryStl(const TriangleMesh& mesh) {
  std::string bytes = "solid, although binary";
  bytes.resize(80, ' ');
  Append(static_cast<std::uint32_t>(mesh.triangles.size()), false, &bytes);
  for (const Triangle& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) Append(0.0f, false, &bytes);
    for (const int i : t) {
      for (int axis = 0; axis < 3; ++axis) {
        Append(static_cast<float>(mesh.vertices[i][axis]), false, &bytes);
      }
    }
    Append(std::uint16_t{0}, false, &bytes);
  }
  return bytes;
}

std::string PlyHeader(const std::string& format, const TriangleMesh& mesh) {
  return "ply\nformat " + format + " 1.0\ncomment made by a test\nelement vertex " +
         std::to_string(mesh.vertices.size()) +
         "\nproperty float x\nproperty double y\nproperty float32 z\nproperty uchar red\n"
         "element face " +
         std::to_string(mesh.triangles.size()) +
         "\nproperty list uchar int vertex_indices\nend_header\n";
}

std::string WriteTextPly(const TriangleMesh& mesh) {
  std::ostringstream text = Text();
  text << PlyHeader("ascii", mesh);
  for (const Vec3& v : mesh.vertices) text << v.x() << " " << v.y() << " " << v.z() << " 200\n";
  for (const auto [a, b, c] : mesh.triangles) text << "3 " << a << " " << b << " " << c << "\n";
  return text.str();
}

std::string WriteBinaryPly(const TriangleMesh& mesh, bool big) {
  std::string bytes = PlyHeader(big ? "binary_big_endian" : "binary_little_endian", mesh);
  for (const Vec3& v : mesh.vertices) {
    Append(static_cast<float>(v.x()), big, &bytes);
    Append(v.y(), big, &bytes);
    Append(static_cast<float>(v.z()), big, &bytes);
    Append(std::uint8_t{200}, big, &bytes);
  }
  for (const Triangle& t : mesh.triangles) {
    Append(std::uint8_t{3}, big, &bytes);
    for (const int i : t) Append(static_cast<std::int32_t>(i), big, &bytes);
  }
  return bytes;
}

}  // namespace

TemporaryFile::TemporaryFile(const std::string& name, const std::string& bytes) {
  std::string pattern = (std::filesystem::temp_directory_path() / "adhesim_test_XXXXXX").string();
  directory_ = mkdtemp(pattern.data());
  path_ = directory_ + "/" + name;
  std::ofstream(path_, std::ios::binary) << bytes;
}

TemporaryFile::~TemporaryFile() {
  std::error_code ignored;
  std::filesystem::remove_all(directory_, ignored);
}

std::string WriteObj(const TriangleMesh& mesh) {
  std::ostringstream text = Text();
  for (const Vec3& v : mesh.vertices) text << "v " << v.x() << " " << v.y() << " " << v.z() << "\n";
  for (const auto [a, b, c] : mesh.triangles) {
    text << "f " << a + 1 << " " << b + 1 << " " << c + 1 << "\n";
  }
  return text.str();
}

std::map<std::string, std::string> InEveryFormat(const TriangleMesh& mesh) {
  return {{"text.obj", WriteObj(mesh)},           {"text.off", WriteOff(mesh)},
          {"text.stl", WriteTextStl(mesh)},       {"binary.stl", WriteBinaryStl(mesh)},
          {"text.ply", WriteTextPly(mesh)},       {"little.ply", WriteBinaryPly(mesh, false)},
          {"big.ply", WriteBinaryPly(mesh, true)}};
}

}  // namespace adhesim
