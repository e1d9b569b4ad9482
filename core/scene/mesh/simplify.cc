#include "core/scene/mesh/simplify.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>
#include <vector>

#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/topology.h"

namespace adhesim {
namespace {

// A triangle's quality: 1 equilateral, 0 without area.
double Quality(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double sides_sq = (b - a).squaredNorm() + (c - b).squaredNorm() + (a - c).squaredNorm();
  return sides_sq > 0 ? 4 * std::sqrt(3.0) * AreaVector(a, b, c).norm() / sides_sq : 0;
}

// The sum of squared distances to planes, weighted by area: x.A x + 2 b.x + const.
struct Quadric {
  Mat3 a = Mat3::Zero();
  Vec3 b = Vec3::Zero();

  void Add(const Quadric& other) {
    a += other.a;
    b += other.b;
  }
};

class Collapser {
 public:
  explicit Collapser(TriangleMesh* mesh)
      : mesh_(*mesh),
        at_(mesh->vertices.size()),
        quadric_(mesh->vertices.size()),
        stamp_(mesh->vertices.size(), 0),
        alive_(mesh->triangles.size(), 1),
        left_(static_cast<int>(mesh->vertices.size())) {
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto [a, b, c] = mesh_.triangles[t];
      const Vec3 area = AreaVector(mesh_.vertices[a], mesh_.vertices[b], mesh_.vertices[c]);
      Quadric plane;
      if (area.norm() > 0) {
        const Vec3 n = area / area.norm();
        plane.a = area.norm() * n * n.transpose();
        plane.b = -area.norm() * n * n.dot(mesh_.vertices[a]);
      }
      for (const int v : {a, b, c}) {
        at_[v].push_back(static_cast<int>(t));
        quadric_[v].Add(plane);
      }
    }
    for (const TriangleSide& side : SortedSides(mesh_.triangles)) {
      if (side.ascending) Push(side.low, side.high);
    }
  }

  int Run(int target) {
    while (left_ > target && !queue_.empty()) {
      const Candidate next = queue_.top();
      queue_.pop();
      // Out of date: one end has moved or gone since.
      if (stamp_[next.low] + stamp_[next.high] != next.stamps) continue;
      if (at_[next.low].empty() || at_[next.high].empty()) continue;
      TryCollapse(next.low, next.high);
    }
    Compact();
    return left_;
  }

 private:
  struct Candidate {
    double length_sq;
    int low, high;
    std::int64_t stamps;
    // The shortest edge is the top of the queue; equal lengths by number.
    bool operator<(const Candidate& other) const {
      return std::tie(length_sq, low, high) > std::tie(other.length_sq, other.low, other.high);
    }
  };

  void Push(int a, int b) {
    const auto [low, high] = std::minmax(a, b);
    queue_.push({(mesh_.vertices[a] - mesh_.vertices[b]).squaredNorm(), low, high,
                 stamp_[low] + stamp_[high]});
  }

  std::vector<int> Neighbours(int v) const {
    std::vector<int> found;
    for (const int t : at_[v]) {
      for (const int other : mesh_.triangles[t]) {
        if (other != v) found.push_back(other);
      }
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  // The middle of the edge, moved along the mean normal to the least sum of squared distances; at
  // most half an edge.
  Vec3 Placement(int a, int b) const {
    Vec3 middle = 0.5 * (mesh_.vertices[a] + mesh_.vertices[b]);
    Vec3 normal = Vec3::Zero();
    for (const int v : {a, b}) {
      for (const int t : at_[v]) {
        const auto [i, j, k] = mesh_.triangles[t];
        normal += AreaVector(mesh_.vertices[i], mesh_.vertices[j], mesh_.vertices[k]);
      }
    }
    if (!(normal.norm() > 0)) return middle;
    normal /= normal.norm();
    Quadric sum = quadric_[a];
    sum.Add(quadric_[b]);
    const double curvature = normal.dot(sum.a * normal);
    if (!(curvature > 0)) return middle;
    const double limit = 0.5 * (mesh_.vertices[a] - mesh_.vertices[b]).norm();
    const double move = -(normal.dot(sum.a * middle) + sum.b.dot(normal)) / curvature;
    return middle + std::clamp(move, -limit, limit) * normal;
  }

  // Whether the triangles of `v` other than those with `gone` stay well-shaped when v moves to
  // `place`.
  bool StaysSound(int v, int gone, const Vec3& place) const {
    constexpr double kLeastQuality = 0.25;  // about 12 degrees
    constexpr double kLeastCosine = 0.5;    // a normal turns by at most 60 degrees
    for (const int t : at_[v]) {
      const Triangle& triangle = mesh_.triangles[t];
      if (std::find(triangle.begin(), triangle.end(), gone) != triangle.end()) continue;
      std::array<Vec3, 3> old, moved;
      for (int k = 0; k < 3; ++k) {
        old[k] = mesh_.vertices[triangle[k]];
        moved[k] = triangle[k] == v ? place : old[k];
      }
      const Vec3 before = AreaVector(old[0], old[1], old[2]);
      const Vec3 after = AreaVector(moved[0], moved[1], moved[2]);
      const double quality = Quality(moved[0], moved[1], moved[2]);
      if (!(after.dot(before) > kLeastCosine * after.norm() * before.norm())) return false;
      if (quality < kLeastQuality && quality < Quality(old[0], old[1], old[2])) return false;
    }
    return true;
  }

  bool TryCollapse(int keep, int gone) {
    const std::vector<int> of_keep = Neighbours(keep), of_gone = Neighbours(gone);
    std::vector<int> common;
    std::set_intersection(of_keep.begin(), of_keep.end(), of_gone.begin(), of_gone.end(),
                          std::back_inserter(common));
    // Link condition of a closed surface: exactly the two opposite vertices are common.
    if (common.size() != 2 || left_ <= 4) return false;
    // Valences after: the merged vertex's, and those of the opposite vertices, which lose one.
    constexpr std::size_t kMostNeighbours = 9, kLeastNeighbours = 4;
    if (of_keep.size() + of_gone.size() - 4 > kMostNeighbours) return false;
    if (of_keep.size() + of_gone.size() - 4 < kLeastNeighbours) return false;
    for (const int opposite : common) {
      if (Neighbours(opposite).size() <= kLeastNeighbours) return false;
    }
    const Vec3 place = Placement(keep, gone);
    if (!StaysSound(keep, gone, place) || !StaysSound(gone, keep, place)) return false;

    for (const int t : std::vector<int>(at_[gone])) {
      Triangle& triangle = mesh_.triangles[t];
      if (std::find(triangle.begin(), triangle.end(), keep) != triangle.end()) {
        alive_[t] = 0;
        for (const int v : triangle) std::erase(at_[v], t);
      } else {
        std::replace(triangle.begin(), triangle.end(), gone, keep);
        at_[keep].push_back(t);
      }
    }
    at_[gone].clear();
    mesh_.vertices[keep] = place;
    quadric_[keep].Add(quadric_[gone]);
    --left_;
    // The merged vertex's edges are new; those around it are tried again because their surroundings
    // have changed.
    ++stamp_[keep];
    const std::vector<int> ring = Neighbours(keep);
    for (const int v : ring) Push(keep, v);
    for (const int v : ring) {
      for (const int t : at_[v]) {
        const Triangle& triangle = mesh_.triangles[t];
        if (std::find(triangle.begin(), triangle.end(), keep) == triangle.end()) continue;
        for (const int other : triangle) {
          if (other != v && other != keep && v < other) Push(v, other);
        }
      }
    }
    return true;
  }

  // Removes what is gone and closes the gaps in the numbers.
  void Compact() {
    TriangleMesh compact;
    std::vector<std::int32_t> number(mesh_.vertices.size(), -1);
    for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) {
      if (at_[v].empty()) continue;
      number[v] = static_cast<std::int32_t>(compact.vertices.size());
      compact.vertices.push_back(mesh_.vertices[v]);
    }
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (!alive_[t]) continue;
      const auto [a, b, c] = mesh_.triangles[t];
      compact.triangles.push_back({number[a], number[b], number[c]});
    }
    mesh_ = std::move(compact);
  }

  TriangleMesh& mesh_;
  std::vector<std::vector<int>> at_;  // triangles at each vertex; empty: the vertex is gone
  std::vector<Quadric> quadric_;
  std::vector<std::int64_t> stamp_;  // how often each vertex has moved
  std::vector<std::uint8_t> alive_;  // per triangle
  int left_;
  std::priority_queue<Candidate> queue_;
};

// Flips edges of a closed manifold while that makes the smallest angles larger.
class Flipper {
 public:
  explicit Flipper(TriangleMesh* mesh) : mesh_(*mesh) {}

  void Run() {
    const int n = static_cast<int>(mesh_.vertices.size());
    valence_.assign(n, 0);
    for (const Triangle& t : mesh_.triangles) {
      for (const int v : t) ++valence_[v];
    }
    neighbours_.assign(n, {});
    const std::vector<TriangleSide> sides = SortedSides(mesh_.triangles);
    for (const TriangleSide& side : sides) {
      if (!side.ascending) continue;
      neighbours_[side.low].push_back(side.high);
      neighbours_[side.high].push_back(side.low);
    }
    // One pass; a triangle that has changed waits for the next.
    changed_.assign(mesh_.triangles.size(), 0);
    ForEachEdge(sides, [&](std::span<const TriangleSide> edge) {
      if (edge.size() == 2) TryFlip(edge[0], edge[1]);
    });
  }

 private:
  static int Opposite(const Triangle& triangle, const TriangleSide& side) {
    for (const int v : triangle) {
      if (v != side.low && v != side.high) return v;
    }
    return -1;
  }

  void TryFlip(const TriangleSide& first, const TriangleSide& second) {
    if (changed_[first.triangle] || changed_[second.triangle]) return;
    const TriangleSide& up = first.ascending ? first : second;    // runs a -> b
    const TriangleSide& down = first.ascending ? second : first;  // runs b -> a
    const int a = up.low, b = up.high;
    const int c = Opposite(mesh_.triangles[up.triangle], up);
    const int d = Opposite(mesh_.triangles[down.triangle], down);
    constexpr int kLeastNeighbours = 4, kMostNeighbours = 9;
    if (valence_[a] <= kLeastNeighbours || valence_[b] <= kLeastNeighbours) return;
    if (valence_[c] >= kMostNeighbours || valence_[d] >= kMostNeighbours) return;
    const std::vector<int>& of_c = neighbours_[c];
    if (std::find(of_c.begin(), of_c.end(), d) != of_c.end()) return;  // the edge exists already

    const Vec3 &pa = mesh_.vertices[a], &pb = mesh_.vertices[b], &pc = mesh_.vertices[c],
               &pd = mesh_.vertices[d];
    const Vec3 n1 = AreaVector(pa, pb, pc), n2 = AreaVector(pb, pa, pd);
    const Vec3 m1 = AreaVector(pc, pa, pd), m2 = AreaVector(pd, pb, pc);
    // Nearly flat before (25 degrees) and after, or the shape would change.
    constexpr double kFlat = 0.9;
    const Vec3 mean = n1 + n2;
    for (const Vec3& normal : {n1, n2, m1, m2}) {
      if (!(normal.dot(mean) > kFlat * normal.norm() * mean.norm())) return;
    }
    const double before = std::min(Quality(pa, pb, pc), Quality(pb, pa, pd));
    const double after = std::min(Quality(pc, pa, pd), Quality(pd, pb, pc));
    if (!(after > before * 1.01)) return;
    mesh_.triangles[up.triangle] = {c, a, d};
    mesh_.triangles[down.triangle] = {d, b, c};
    changed_[up.triangle] = changed_[down.triangle] = 1;
    std::erase(neighbours_[a], b);
    std::erase(neighbours_[b], a);
    neighbours_[c].push_back(d);
    neighbours_[d].push_back(c);
    --valence_[a], --valence_[b], ++valence_[c], ++valence_[d];
  }

  TriangleMesh& mesh_;
  std::vector<int> valence_;
  std::vector<std::vector<int>> neighbours_;
  std::vector<std::uint8_t> changed_;  // per triangle
};

// The mean of each vertex's neighbours, minus the vertex.
std::vector<Vec3> TowardsNeighbours(const TriangleMesh& mesh, const IndexLists& neighbours) {
  std::vector<Vec3> steps(mesh.vertices.size());
  for (std::size_t v = 0; v < steps.size(); ++v) {
    Vec3 sum = Vec3::Zero();
    const int first = neighbours.start[v], last = neighbours.start[v + 1];
    for (int k = first; k < last; ++k) sum += mesh.vertices[neighbours.values[k]];
    steps[v] = last > first ? Vec3(sum / (last - first) - mesh.vertices[v]) : Vec3::Zero();
  }
  return steps;
}

IndexLists NeighboursOf(const TriangleMesh& mesh) {
  return VertexNeighbours(SortedSides(mesh.triangles), static_cast<int>(mesh.vertices.size()));
}

}  // namespace

void SmoothTaubin(int rounds, TriangleMesh* mesh) {
  const IndexLists neighbours = NeighboursOf(*mesh);
  for (int round = 0; round < rounds; ++round) {
    for (const double factor : {0.5, -0.53}) {
      const std::vector<Vec3> steps = TowardsNeighbours(*mesh, neighbours);
      for (std::size_t v = 0; v < steps.size(); ++v) mesh->vertices[v] += factor * steps[v];
    }
  }
}

int CollapseEdges(int target_vertices, TriangleMesh* mesh) {
  return Collapser(mesh).Run(target_vertices);
}

absl::StatusOr<TriangleMesh> Decimated(const TriangleMesh& mesh, int vertices) {
  const MeshReport report = CheckMesh(mesh).report;
  if (!report.closed || !report.manifold || !report.oriented) {
    return absl::InvalidArgumentError(
        "only closed, oriented surfaces can be decimated, and this one is not; mend it, or leave "
        "'particles' out");
  }
  const int before = report.vertices;
  if (vertices > before) {
    return absl::InvalidArgumentError(absl::StrCat("cannot be decimated to ", vertices,
                                                   " particles: it has ", before,
                                                   "; permitted: at most that"));
  }
  TriangleMesh decimated = mesh;
  const int left = CollapseEdges(vertices, &decimated);
  if (left == vertices) return decimated;
  return absl::InvalidArgumentError(absl::StrCat("cannot be decimated to ", vertices,
                                                 " particles and keep its shape; permitted: ", left,
                                                 " to ", before));
}

void EvenTriangles(int rounds, TriangleMesh* mesh) {
  for (int round = 0; round < rounds; ++round) {
    Flipper(mesh).Run();
    std::vector<Vec3> normals(mesh->vertices.size(), Vec3::Zero());
    for (const auto [a, b, c] : mesh->triangles) {
      const Vec3 area = AreaVector(mesh->vertices[a], mesh->vertices[b], mesh->vertices[c]);
      for (const int v : {a, b, c}) normals[v] += area;
    }
    const std::vector<Vec3> steps = TowardsNeighbours(*mesh, NeighboursOf(*mesh));
    for (std::size_t v = 0; v < steps.size(); ++v) {
      const double length_sq = normals[v].squaredNorm();
      if (!(length_sq > 0)) continue;
      mesh->vertices[v] += 0.3 * (steps[v] - normals[v] * (normals[v].dot(steps[v]) / length_sq));
    }
  }
}

}  // namespace adhesim
