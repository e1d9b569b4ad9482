#include "core/scene/mesh/check_mesh.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include "core/scene/mesh/topology.h"

namespace adhesim {
namespace {

// A surface of more pieces than this is a soup of triangles, not an organ with its vessels.
constexpr int kMaxPieces = 1000;

// "triangle 4", "triangles 4, 7, 9 and 12 more" (counted from 0).
std::string Few(const char* one, const char* many, const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 3;
  std::string text = absl::StrCat(names.size() == 1 ? one : many, " ");
  for (std::size_t i = 0; i < std::min(kShown, names.size()); ++i) {
    absl::StrAppend(&text, i == 0 ? "" : ", ", names[i]);
  }
  if (names.size() > kShown) absl::StrAppend(&text, " and ", names.size() - kShown, " more");
  return absl::StrCat(text, " (counted from 0)");
}

// Root of an element in a union-find forest, halving the path.
int Root(std::vector<int>& parent, int i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

class Checker {
 public:
  explicit Checker(const TriangleMesh& mesh) : mesh_(mesh) {}

  MeshCheck Run() {
    report_.vertices = static_cast<int>(mesh_.vertices.size());
    report_.triangles = static_cast<int>(mesh_.triangles.size());
    if (report_.triangles == 0) {
      AddFlaw("the mesh has no triangles");
      return {report_, flaws_};
    }
    // Everything else would be guesswork on numbers or indices that mean nothing.
    if (!CheckNumbers()) return {report_, flaws_};
    MeasureTriangles();
    CheckEdges();
    CheckWinding();
    CheckVertices();
    CheckComponents();
    CheckVolume();
    return {report_, flaws_};
  }

 private:
  void AddFlaw(std::string message, bool warning = false) {
    flaws_.push_back({std::move(message), warning});
  }

  bool CheckNumbers() {
    std::vector<std::string> bad_vertices, bad_triangles;
    for (int v = 0; v < report_.vertices; ++v) {
      if (!mesh_.vertices[v].allFinite()) bad_vertices.push_back(absl::StrCat(v));
    }
    for (int t = 0; t < report_.triangles; ++t) {
      for (const int v : mesh_.triangles[t]) {
        if (v < 0 || v >= report_.vertices) {
          bad_triangles.push_back(absl::StrCat(t));
          break;
        }
      }
    }
    report_.bad_numbers = static_cast<int>(bad_vertices.size());
    report_.bad_indices = static_cast<int>(bad_triangles.size());
    if (!bad_vertices.empty()) {
      AddFlaw(absl::StrCat(Few("vertex", "vertices", bad_vertices),
                           ": coordinates that are not finite numbers (NaN or infinity)"));
    }
    if (!bad_triangles.empty()) {
      AddFlaw(absl::StrCat(Few("triangle", "triangles", bad_triangles),
                           ": names a vertex outside 0..", report_.vertices - 1));
    }
    return flaws_.empty();
  }

  // Lengths, angles, areas; sorts out degenerate and duplicate triangles.
  void MeasureTriangles() {
    report_.min_edge_m = std::numeric_limits<double>::infinity();
    double max_cosine = -1;
    std::vector<std::string> degenerate;
    for (int t = 0; t < report_.triangles; ++t) {
      const auto [a, b, c] = mesh_.triangles[t];
      const std::array<Vec3, 3> corner = {mesh_.vertices[a], mesh_.vertices[b], mesh_.vertices[c]};
      const double area = AreaVector(corner[0], corner[1], corner[2]).norm();
      for (int k = 0; k < 3; ++k) {
        const Vec3 next = corner[(k + 1) % 3] - corner[k], last = corner[(k + 2) % 3] - corner[k];
        report_.min_edge_m = std::min(report_.min_edge_m, next.norm());
        report_.max_edge_m = std::max(report_.max_edge_m, next.norm());
        const double lengths = next.norm() * last.norm();
        max_cosine = std::max(max_cosine, lengths > 0 ? next.dot(last) / lengths : 1.0);
        report_.box.Add(corner[k]);
      }
      report_.area_m2 += area;
      if (a == b || b == c || c == a || !HasArea(corner[0], corner[1], corner[2])) {
        degenerate.push_back(absl::StrCat(t));
      }
      if (a != b && b != c && c != a) surface_.push_back(t);
    }
    report_.min_angle_deg = std::acos(std::min(1.0, max_cosine)) * 180 / std::numbers::pi;
    report_.degenerate_triangles = static_cast<int>(degenerate.size());
    if (!degenerate.empty()) {
      AddFlaw(absl::StrCat("degenerate ", Few("triangle", "triangles", degenerate),
                           ": no area; remove it (merge its vertices)"));
    }
    RemoveDuplicates();
    for (const int t : surface_) kept_.push_back(mesh_.triangles[t]);
    sides_ = SortedSides(kept_);
  }

  // Takes triangles with the same three vertices as an earlier one off the surface.
  void RemoveDuplicates() {
    std::vector<std::pair<Triangle, int>> sorted;
    for (const int t : surface_) {
      Triangle key = mesh_.triangles[t];
      std::sort(key.begin(), key.end());
      sorted.emplace_back(key, t);
    }
    std::sort(sorted.begin(), sorted.end());
    std::vector<int> duplicates;
    for (std::size_t i = 1; i < sorted.size(); ++i) {
      if (sorted[i].first == sorted[i - 1].first) duplicates.push_back(sorted[i].second);
    }
    report_.duplicate_triangles = static_cast<int>(duplicates.size());
    if (duplicates.empty()) return;
    std::sort(duplicates.begin(), duplicates.end());
    std::vector<std::string> names;
    for (const int t : duplicates) names.push_back(absl::StrCat(t));
    AddFlaw(absl::StrCat("duplicate ", Few("triangle", "triangles", names),
                         ": the same three vertices as an earlier triangle; remove it"));
    std::erase_if(surface_, [&](int t) {
      return std::binary_search(duplicates.begin(), duplicates.end(), t);
    });
  }

  void CheckEdges() {
    std::vector<std::string> bad;
    ForEachEdge(sides_, [&](std::span<const TriangleSide> edge) {
      ++report_.edges;
      if (edge.size() == 1) ++report_.boundary_edges;
      if (edge.size() == 2 && edge[0].ascending == edge[1].ascending) ++report_.inconsistent_edges;
      if (edge.size() > 2) bad.push_back(absl::StrCat(edge[0].low, "-", edge[0].high));
    });
    report_.non_manifold_edges = static_cast<int>(bad.size());
    report_.closed = !kept_.empty() && bad.empty() && report_.boundary_edges == 0;
    if (!bad.empty()) {
      AddFlaw(absl::StrCat("non-manifold ", Few("edge", "edges", bad),
                           ": more than two triangles share it; a body's surface has one or two"));
    }
  }

  // Names the triangles that face the other way than most of their piece.
  void CheckWinding() {
    report_.oriented = report_.inconsistent_edges == 0 && report_.non_manifold_edges == 0;
    if (report_.inconsistent_edges == 0) return;
    const Facing facing = FindFacing(sides_, static_cast<int>(kept_.size()));
    if (facing.one_sided) {
      AddFlaw("the surface has one side only (like a Moebius strip): it has no outside");
      return;
    }
    std::vector<std::string> flipped;
    for (std::size_t t = 0; t < kept_.size(); ++t) {
      if (facing.flipped[t]) flipped.push_back(absl::StrCat(surface_[t]));
    }
    AddFlaw(absl::StrCat("flipped winding: ", Few("triangle", "triangles", flipped),
                         " faces the other way than its neighbours; swap two of its vertices"));
  }

  // Vertices without triangles, and vertices at which several fans of triangles touch in a point.
  void CheckVertices() {
    std::vector<std::uint8_t> used(report_.vertices, 0);
    for (const Triangle& triangle : mesh_.triangles) {
      for (const int v : triangle) used[v] = 1;
    }
    std::vector<std::string> unused;
    for (int v = 0; v < report_.vertices; ++v) {
      if (!used[v]) unused.push_back(absl::StrCat(v));
    }
    report_.unused_vertices = static_cast<int>(unused.size());
    if (!unused.empty()) {
      AddFlaw(absl::StrCat("unused ", Few("vertex", "vertices", unused),
                           ": in no triangle, so it would have no mass; remove it"));
    }

    // Corners 3t + k joined across edges: a manifold vertex has one set of joined corners.
    std::vector<int> parent(3 * kept_.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto corner = [&](int t, int v) {
      return 3 * t +
             static_cast<int>(std::find(kept_[t].begin(), kept_[t].end(), v) - kept_[t].begin());
    };
    ForEachEdge(sides_, [&](std::span<const TriangleSide> edge) {
      for (std::size_t i = 1; i < edge.size(); ++i) {
        for (const int v : {edge[0].low, edge[0].high}) {
          parent[Root(parent, corner(edge[i].triangle, v))] =
              Root(parent, corner(edge[0].triangle, v));
        }
      }
    });
    std::vector<int> fans(report_.vertices, 0);
    for (int i = 0; i < static_cast<int>(parent.size()); ++i) {
      if (parent[i] == i) ++fans[kept_[i / 3][i % 3]];
    }
    std::vector<std::string> touching;
    for (int v = 0; v < report_.vertices; ++v) {
      if (fans[v] > 1) touching.push_back(absl::StrCat(v));
    }
    report_.non_manifold_vertices = static_cast<int>(touching.size());
    report_.manifold = report_.non_manifold_edges == 0 && touching.empty();
    // Around a non-manifold edge, a duplicate or a degenerate triangle this is a consequence.
    if (!touching.empty() && flaws_.empty()) {
      AddFlaw(absl::StrCat("non-manifold ", Few("vertex", "vertices", touching),
                           ": parts of the surface touch in this single point; split it"));
    }
  }

  void CheckComponents() {
    component_.resize(report_.vertices);
    std::iota(component_.begin(), component_.end(), 0);
    for (const auto [a, b, c] : kept_) {
      component_[Root(component_, b)] = Root(component_, a);
      component_[Root(component_, c)] = Root(component_, a);
    }
    std::vector<std::uint8_t> is_component(report_.vertices, 0);
    for (const Triangle& triangle : kept_) is_component[Root(component_, triangle[0])] = 1;
    report_.components = static_cast<int>(std::count(is_component.begin(), is_component.end(), 1));
    report_.euler_characteristic =
        report_.vertices - report_.unused_vertices - report_.edges + static_cast<int>(kept_.size());
    if (report_.closed && report_.manifold && report_.oriented) {
      report_.genus = report_.components - report_.euler_characteristic / 2;
    }
    if (report_.components > kMaxPieces) {
      AddFlaw(absl::StrCat("the surface falls apart into ", report_.components, " pieces (at most ",
                           kMaxPieces,
                           " are permitted); probably its triangles do not share vertices: merge "
                           "vertices at the same place"));
    } else if (report_.components > 1) {
      AddFlaw(absl::StrCat("the surface has ", report_.components,
                           " separate pieces; they move independently of each other"),
              /*warning=*/true);
    }
  }

  // The enclosed volume, and pieces that are inside out. A piece inside another may be: it bounds a
  // cavity.
  void CheckVolume() {
    if (!report_.closed || !report_.oriented) return;
    report_.volume_m3 = EnclosedVolume({mesh_.vertices, kept_});
    const bool inside_out =
        !(report_.volume_m3 > 0) || (report_.components <= kMaxPieces && HasInsideOutPiece());
    // Without an area there is no volume: a consequence.
    if (inside_out && report_.degenerate_triangles == 0) {
      AddFlaw(
          absl::StrCat("flipped winding: the closed surface, or a piece of it, is inside out "
                       "(volume ",
                       report_.volume_m3, " m^3); reverse the vertex order of its triangles"));
    }
  }

  bool HasInsideOutPiece() {
    struct Piece {
      Aabb box;
      double volume_m3 = 0;
    };
    std::map<int, Piece> pieces;  // by root
    const Vec3 origin = 0.5 * (report_.box.min + report_.box.max);
    for (const auto [ia, ib, ic] : kept_) {
      const Vec3 a = mesh_.vertices[ia] - origin, b = mesh_.vertices[ib] - origin,
                 c = mesh_.vertices[ic] - origin;
      Piece& piece = pieces[Root(component_, ia)];
      piece.volume_m3 += a.dot(b.cross(c)) / 6;
      for (const Vec3& p : {a, b, c}) piece.box.Add(p);
    }
    return std::any_of(pieces.begin(), pieces.end(), [&](const auto& inner) {
      const Piece& piece = inner.second;
      if (piece.volume_m3 > 0) return false;
      return std::none_of(pieces.begin(), pieces.end(), [&](const auto& outer) {
        return outer.second.volume_m3 > 0 && outer.second.box.Contains(piece.box.min) &&
               outer.second.box.Contains(piece.box.max);
      });
    });
  }

  const TriangleMesh& mesh_;
  MeshReport report_;
  std::vector<MeshFlaw> flaws_;
  std::vector<int> surface_;         // triangles with three different vertices, without duplicates
  std::vector<Triangle> kept_;       // the same triangles
  std::vector<TriangleSide> sides_;  // of kept_
  std::vector<int> component_;       // union-find forest over the vertices
};

}  // namespace

MeshCheck CheckMesh(const TriangleMesh& mesh) { return Checker(mesh).Run(); }

}  // namespace adhesim
