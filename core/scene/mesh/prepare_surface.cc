#include "core/scene/mesh/prepare_surface.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "core/scene/mesh/fill_cells.h"
#include "core/scene/mesh/topology.h"

namespace adhesim {

TriangleMesh CleanSurface(const TriangleMesh& surface) {
  TriangleMesh clean;
  std::set<Triangle> seen;
  for (const Triangle& triangle : surface.triangles) {
    const auto [a, b, c] = triangle;
    if (!HasArea(surface.vertices[a], surface.vertices[b], surface.vertices[c])) continue;
    Triangle key = triangle;
    std::sort(key.begin(), key.end());
    if (seen.insert(key).second) clean.triangles.push_back(triangle);
  }
  std::vector<std::int32_t> number(surface.vertices.size(), -1);
  for (const Triangle& triangle : clean.triangles) {
    for (const std::int32_t v : triangle) number[v] = 0;
  }
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] < 0) continue;
    number[v] = static_cast<std::int32_t>(clean.vertices.size());
    clean.vertices.push_back(surface.vertices[v]);
  }
  const Facing facing = FindFacing(SortedSides(clean.triangles), clean.triangles.size());
  for (std::size_t t = 0; t < clean.triangles.size(); ++t) {
    Triangle& triangle = clean.triangles[t];
    for (std::int32_t& v : triangle) v = number[v];
    if (facing.flipped[t]) std::swap(triangle[1], triangle[2]);
  }
  return clean;
}

bool FaceOutward(const WindingNumber& winding, TriangleMesh* surface) {
  const auto count = static_cast<int>(surface->triangles.size());
  const Facing facing = FindFacing(SortedSides(surface->triangles), count);
  std::vector<int> size(facing.pieces, 0), member(facing.pieces, 0);
  for (const std::int32_t piece : facing.piece) ++size[piece];
  // By area, of some sixty triangles of each piece: how much has the inside behind less in front.
  constexpr int kVoters = 64;
  std::vector<double> behind_m2(facing.pieces, 0);
  bool encloses = false;
  for (int t = 0; t < count; ++t) {
    const std::int32_t piece = facing.piece[t];
    if (member[piece]++ % (size[piece] / kVoters + 1) != 0) continue;
    const auto [ia, ib, ic] = surface->triangles[t];
    const Vec3 &a = surface->vertices[ia], &b = surface->vertices[ib], &c = surface->vertices[ic];
    const Vec3 area = AreaVector(a, b, c);
    const double area_m2 = area.norm();
    const Vec3 step = area / std::sqrt(area_m2) * 0.01, centre = (a + b + c) / 3;
    const bool front = IsInside(winding, centre + step), back = IsInside(winding, centre - step);
    if (front != back) behind_m2[piece] += back ? area_m2 : -area_m2;
    encloses = encloses || front != back;
  }
  for (int t = 0; t < count; ++t) {
    Triangle& triangle = surface->triangles[t];
    if (behind_m2[facing.piece[t]] < 0) std::swap(triangle[1], triangle[2]);
  }
  return encloses;
}

}  // namespace adhesim
