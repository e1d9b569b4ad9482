#include "core/scene/mesh/generate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "core/scene/mesh/lattice.h"

namespace adhesim {
namespace {

// The icosahedron with vertices at distance `radius_m`; triangles counter-clockwise from outside.
TriangleMesh Icosahedron(double radius_m) {
  const double g = (1.0 + std::sqrt(5.0)) / 2.0;  // golden ratio
  TriangleMesh mesh;
  mesh.vertices = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                   {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (Vec3& v : mesh.vertices) v *= radius_m / v.norm();
  mesh.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                    {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                    {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                    {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  return mesh;
}

}  // namespace

TriangleMesh MakeIcosphere(double radius_m, int subdivisions) {
  TriangleMesh mesh = Icosahedron(radius_m);
  for (int level = 0; level < subdivisions; ++level) {
    std::map<std::pair<int, int>, int> midpoints;  // of edges, made once for both triangles
    const auto midpoint = [&](int a, int b) {
      const auto [it, is_new] =
          midpoints.try_emplace(std::minmax(a, b), static_cast<int>(mesh.vertices.size()));
      if (is_new) {
        const Vec3 m = mesh.vertices[a] + mesh.vertices[b];
        mesh.vertices.push_back(m * (radius_m / m.norm()));
      }
      return it->second;
    };
    std::vector<Triangle> finer;
    finer.reserve(mesh.triangles.size() * 4);
    for (const auto [a, b, c] : mesh.triangles) {
      const int ab = midpoint(a, b), bc = midpoint(b, c), ca = midpoint(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    mesh.triangles = std::move(finer);
  }
  return mesh;
}

TriangleMesh MakeSheet(double length_m, double width_m, int columns, int rows) {
  TriangleMesh mesh;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      mesh.vertices.emplace_back(length_m * (static_cast<double>(column) / (columns - 1) - 0.5),
                                 width_m * (static_cast<double>(row) / (rows - 1) - 0.5), 0.0);
    }
  }
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const int a = row * columns + column, b = a + 1, c = b + columns, d = a + columns;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

TriangleMesh MakeBlock(const Vec3& size_m, int cells) {
  const std::array<int, 3> n = CellsAlong(size_m, cells);
  TriangleMesh mesh;
  // Vertices: lattice points of the surface, x fastest. Each is found again by its lattice number.
  std::map<std::int64_t, int> vertex_at;
  const auto lattice_number = [&](int x, int y, int z) {
    return (static_cast<std::int64_t>(z) * (n[1] + 1) + y) * (n[0] + 1) + x;
  };
  for (int z = 0; z <= n[2]; ++z) {
    for (int y = 0; y <= n[1]; ++y) {
      // Inside the block only the two ends of a row are on the surface.
      const bool whole_row = z == 0 || z == n[2] || y == 0 || y == n[1];
      for (int x = 0; x <= n[0]; x += whole_row ? 1 : n[0]) {
        vertex_at[lattice_number(x, y, z)] = static_cast<int>(mesh.vertices.size());
        mesh.vertices.emplace_back(size_m.x() * (static_cast<double>(x) / n[0] - 0.5),
                                   size_m.y() * (static_cast<double>(y) / n[1] - 0.5),
                                   size_m.z() * (static_cast<double>(z) / n[2] - 0.5));
      }
    }
  }
  // Each axis has two faces, spanned by the next two axes (u, v) with u x v along +axis.
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const int level : {0, n[axis]}) {
      const auto vertex = [&](int at_u, int at_v) {
        std::array<int, 3> p;
        p[axis] = level;
        p[u] = at_u;
        p[v] = at_v;
        return vertex_at.at(lattice_number(p[0], p[1], p[2]));
      };
      for (int j = 0; j < n[v]; ++j) {
        for (int i = 0; i < n[u]; ++i) {
          const int a = vertex(i, j), c = vertex(i + 1, j + 1);
          int b = vertex(i + 1, j), d = vertex(i, j + 1);
          if (level == 0) std::swap(b, d);  // this face looks along -axis
          mesh.triangles.push_back({a, b, c});
          mesh.triangles.push_back({a, c, d});
        }
      }
    }
  }
  return mesh;
}

}  // namespace adhesim
