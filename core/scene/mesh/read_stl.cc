#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <tuple>
#include <vector>

#include "core/scene/mesh/bytes.h"
#include "core/scene/mesh/mesh_formats.h"
#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/read_mesh.h"

namespace adhesim {
namespace {

constexpr std::size_t kHeaderBytes = 84;  // 80 of comment, then the number of triangles
constexpr std::size_t kFacetBytes = 50;   // normal, three vertices (float), 2 unused

// STL repeats every vertex in each of its triangles. Those with equal coordinates become one,
// numbered in the order of their first appearance.
TriangleMesh MergeCorners(const std::vector<Vec3>& corners) {
  std::vector<std::int32_t> order(corners.size());
  std::iota(order.begin(), order.end(), 0);
  const auto less = [&](std::int32_t i, std::int32_t j) {
    const Vec3 &a = corners[i], &b = corners[j];
    return std::tie(a.x(), a.y(), a.z(), i) < std::tie(b.x(), b.y(), b.z(), j);
  };
  std::sort(order.begin(), order.end(), less);
  std::vector<std::int32_t> first(corners.size());  // the first corner at the same place
  for (std::size_t k = 0; k < order.size(); ++k) {
    const bool same = k > 0 && corners[order[k]] == corners[order[k - 1]];
    first[order[k]] = same ? first[order[k - 1]] : order[k];
  }
  TriangleMesh mesh;
  std::vector<std::int32_t> vertex_of(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (first[i] == static_cast<std::int32_t>(i)) {
      vertex_of[i] = static_cast<std::int32_t>(mesh.vertices.size());
      mesh.vertices.push_back(corners[i]);
    } else {
      vertex_of[i] = vertex_of[first[i]];
    }
  }
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
    mesh.triangles.push_back({vertex_of[i], vertex_of[i + 1], vertex_of[i + 2]});
  }
  return mesh;
}

absl::StatusOr<TriangleMesh> ParseBinary(absl::string_view bytes) {
  const std::size_t count = (bytes.size() - kHeaderBytes) / kFacetBytes;
  if (count > kMaxMeshTriangles) {
    return absl::InvalidArgumentError(
        absl::StrCat(count, " triangles; at most ", kMaxMeshTriangles, " are permitted"));
  }
  std::vector<Vec3> corners;
  corners.reserve(3 * count);
  for (std::size_t facet = 0; facet < count; ++facet) {
    for (int k = 0; k < 3; ++k) {
      const std::size_t at = kHeaderBytes + facet * kFacetBytes + 12 * (k + 1);
      Vec3 p;
      for (int axis = 0; axis < 3; ++axis) p[axis] = LoadNumber<float>(bytes, at + 4 * axis, false);
      if (!p.allFinite()) {
        return absl::InvalidArgumentError(absl::StrCat(
            "triangle ", facet, " (counted from 0): coordinate is not a finite number"));
      }
      corners.push_back(p);
    }
  }
  return MergeCorners(corners);
}

// Words of the text form, in their fixed order; facets repeat.
absl::StatusOr<TriangleMesh> ParseText(absl::string_view bytes) {
  LineReader line(bytes, 0);
  std::vector<Vec3> corners;
  std::size_t in_loop = 0;  // vertices of the current facet
  bool open = false, ended = false;
  while (line.Next()) {
    const absl::string_view word = line.words()[0];
    if (word == "facet") {
      if (open) return line.Error("a facet begins before the last one has ended");
      open = true;
      in_loop = 0;
    } else if (word == "vertex") {
      if (!open) return line.Error("a vertex outside a facet");
      Vec3 p;
      if (absl::Status s = ParsePoint(line, 1, &p); !s.ok()) return s;
      corners.push_back(p);
      ++in_loop;
    } else if (word == "endfacet") {
      if (!open || in_loop != 3) return line.Error("a facet must have three vertices");
      open = false;
    } else if (word == "endsolid") {
      ended = true;
    } else if (word != "solid" && word != "outer" && word != "endloop") {
      return line.Error("not a statement of an STL file");
    }
    if (corners.size() > 3 * kMaxMeshTriangles) {
      return line.Error(absl::StrCat("more than ", kMaxMeshTriangles, " triangles"));
    }
  }
  if (open || !ended) return line.Error("the file ends before 'endsolid'");
  return MergeCorners(corners);
}

}  // namespace

absl::StatusOr<TriangleMesh> ParseStl(absl::string_view bytes) {
  // Some binary files begin with "solid" too: the length decides.
  std::size_t stated_bytes = 0;
  if (bytes.size() >= kHeaderBytes) {
    stated_bytes =
        kHeaderBytes + kFacetBytes * std::size_t{LoadNumber<std::uint32_t>(bytes, 80, false)};
    if (bytes.size() == stated_bytes) return ParseBinary(bytes);
  }
  if (absl::StartsWith(bytes, "solid") && bytes.find('\0') == bytes.npos) return ParseText(bytes);
  if (stated_bytes == 0) return absl::InvalidArgumentError("too short for an STL file");
  return absl::InvalidArgumentError(
      absl::StrCat("a binary STL file with this number of triangles has ", stated_bytes,
                   " bytes; this one has ", bytes.size()));
}

}  // namespace adhesim
