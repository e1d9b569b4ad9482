#include "core/scene/mesh/embed.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/scene/mesh/check_mesh.h"
#include "core/scene/mesh/prepare_surface.h"
#include "core/scene/mesh/topology.h"
#include "core/scene/mesh/winding_number.h"

namespace adhesim {
namespace {

// The furthest that a vertex may be outside of the tetrahedron that carries it, in its heights.
constexpr double kFurthestOutside = 0.5;

// A volume further from the surface's than this is worth a warning.
constexpr double kMostVolumeError = 0.05;

// Cubes around the surface. A little more than its extent, so that it touches no border.
Lattice LatticeAround(const TriangleMesh& surface, int cells) {
  Aabb box;
  for (const Vec3& v : surface.vertices) box.Add(v);
  const Vec3 extent = (box.max - box.min) * (1 + 1e-6);
  Lattice lattice;
  lattice.cell_m = extent.maxCoeff() / cells;
  Vec3 size;
  for (int axis = 0; axis < 3; ++axis) {
    // Rounding must not add a cell to the longest extent.
    const double n = std::ceil(extent[axis] / lattice.cell_m * (1 - 1e-9));
    lattice.size[axis] = std::max(1, static_cast<int>(n));
    size[axis] = lattice.size[axis] * lattice.cell_m;
  }
  lattice.origin = 0.5 * (box.min + box.max) - 0.5 * size;
  return lattice;
}

// Part of a cell's volume in its tetrahedron k.
double PartOf(int k) { return k == 0 ? 1.0 / 3 : 1.0 / 6; }

class Embedder {
 public:
  Embedder(const Lattice& lattice, std::vector<FilledCell> cells, TriangleMesh surface)
      : lattice_(lattice), cells_(std::move(cells)), surface_(std::move(surface)) {
    slot_of_.assign(lattice_.cell_count(), -1);
    for (std::size_t s = 0; s < cells_.size(); ++s) {
      slot_of_[cells_[s].cell] = static_cast<std::int32_t>(s);
    }
    candidate_.resize(5 * cells_.size());
    kept_.resize(candidate_.size());
    for (std::size_t e = 0; e < candidate_.size(); ++e) {
      candidate_[e] = Fill(e) > 0 || (cells_[e / 5].touched >> (e % 5) & 1);
      kept_[e] = Fill(e) >= kLeastFill;
    }
  }

  absl::StatusOr<TetMesh> Run() {
    component_ = Components(candidate_);
    KeepTogether();
    CarryVertices();
    return Result();
  }

 private:
  // Tetrahedra are numbered 5 * slot + k.
  float Fill(std::size_t e) const { return cells_[e / 5].fill[e % 5]; }
  std::array<std::int32_t, 4> NodesOf(std::size_t e) const {
    const std::int32_t cell = cells_[e / 5].cell;
    const auto& corners = CellTetrahedra(lattice_.CellAt(cell))[e % 5];
    std::array<std::int32_t, 4> nodes;
    for (int k = 0; k < 4; ++k) nodes[k] = lattice_.Corner(cell, corners[k]);
    return nodes;
  }

  // Calls visit(number) for the tetrahedra across its faces: the one in the middle of a cell has
  // the four at its corners around it; one at a corner has those at the same node in the next
  // cells.
  template <typename Visit>
  void ForEachNeighbour(std::size_t e, Visit visit) const {
    const std::size_t slot = e / 5, k = e % 5;
    if (k == 0) {
      for (int other = 1; other < 5; ++other) visit(5 * slot + other);
      return;
    }
    visit(5 * slot);
    const std::array<int, 3> at = lattice_.CellAt(cells_[slot].cell);
    const int corner = CellTetrahedra(at)[k][0];
    for (int axis = 0; axis < 3; ++axis) {
      std::array<int, 3> next = at;
      next[axis] += corner >> axis & 1 ? 1 : -1;
      if (next[axis] < 0 || next[axis] >= lattice_.size[axis]) continue;
      const std::int32_t other = slot_of_[lattice_.Cell(next[0], next[1], next[2])];
      if (other < 0) continue;
      for (int j = 1; j < 5; ++j) {
        if (CellTetrahedra(next)[j][0] == (corner ^ 1 << axis)) visit(5 * std::size_t(other) + j);
      }
    }
  }

  // The number of the set of tetrahedra, connected by faces, that each belongs to; -1: to none.
  std::vector<std::int32_t> Components(const std::vector<std::uint8_t>& members) const {
    std::vector<std::int32_t> component(members.size(), -1);
    std::vector<std::size_t> stack;
    std::int32_t count = 0;
    for (std::size_t start = 0; start < members.size(); ++start) {
      if (!members[start] || component[start] >= 0) continue;
      component[start] = count;
      stack = {start};
      while (!stack.empty()) {
        const std::size_t e = stack.back();
        stack.pop_back();
        ForEachNeighbour(e, [&](std::size_t other) {
          if (!members[other] || component[other] >= 0) return;
          component[other] = count;
          stack.push_back(other);
        });
      }
      ++count;
    }
    return component;
  }

  void KeepAllOf(const std::vector<std::uint8_t>& component_whole) {
    for (std::size_t e = 0; e < kept_.size(); ++e) {
      if (component_[e] >= 0 && component_whole[component_[e]]) kept_[e] = 1;
    }
  }

  // Slivers are left out, but not where that would cut a component in two or leave nothing of it.
  void KeepTogether() {
    const std::vector<std::int32_t> part = Components(kept_);
    std::vector<std::int32_t> part_of(ComponentCount(), -1);
    std::vector<std::uint8_t> whole(ComponentCount(), 0);
    for (std::size_t e = 0; e < kept_.size(); ++e) {
      if (!kept_[e]) continue;
      std::int32_t& first = part_of[component_[e]];
      if (first < 0) first = part[e];
      if (first != part[e]) whole[component_[e]] = 1;
    }
    for (std::size_t c = 0; c < whole.size(); ++c) whole[c] |= part_of[c] < 0;
    KeepAllOf(whole);
  }

  std::size_t ComponentCount() const {
    const auto last = std::max_element(component_.begin(), component_.end());
    return last == component_.end() ? 0 : *last + 1;
  }

  struct Carrier {
    std::size_t tetrahedron = 0;
    std::array<double, 4> weights{};
    double least_weight = -std::numeric_limits<double>::infinity();
  };

  Carrier WeightsIn(std::size_t e, const Vec3& point) const {
    std::array<Vec3, 4> corner;
    const std::array<std::int32_t, 4> nodes = NodesOf(e);
    for (int k = 0; k < 4; ++k) corner[k] = lattice_.NodePosition(nodes[k]);
    const auto [a, b, c, d] = corner;
    const double six = 6 * TetVolume(a, b, c, d);
    Carrier carrier{e};
    auto& w = carrier.weights;
    w[1] = 6 * TetVolume(a, point, c, d) / six;
    w[2] = 6 * TetVolume(a, b, point, d) / six;
    w[3] = 6 * TetVolume(a, b, c, point) / six;
    w[0] = 1 - w[1] - w[2] - w[3];
    // On a face or an edge, the corners off it carry nothing: not round-off.
    for (double& weight : w) weight = std::abs(weight) < 1e-9 ? 0 : weight;
    double& largest = *std::max_element(w.begin(), w.end());
    largest += 1 - (w[0] + w[1] + w[2] + w[3]);
    carrier.least_weight = *std::min_element(w.begin(), w.end());
    return carrier;
  }

  // Of the members in the point's cell and those around it, the one that it is outside of the
  // least.
  Carrier Nearest(const std::vector<std::uint8_t>& members, const Vec3& point) const {
    std::array<int, 3> at;
    for (int axis = 0; axis < 3; ++axis) {
      const double x = (point[axis] - lattice_.origin[axis]) / lattice_.cell_m;
      at[axis] = std::clamp(static_cast<int>(std::floor(x)), 0, lattice_.size[axis] - 1);
    }
    Carrier best;
    const auto look = [&](int x, int y, int z) {
      const std::int32_t slot = slot_of_[lattice_.Cell(x, y, z)];
      for (std::size_t e = 5 * std::size_t(slot); slot >= 0 && e < 5 * std::size_t(slot) + 5; ++e) {
        if (!members[e]) continue;
        const Carrier carrier = WeightsIn(e, point);
        if (carrier.least_weight > best.least_weight) best = carrier;
      }
    };
    look(at[0], at[1], at[2]);
    if (best.least_weight >= 0) return best;
    for (int z = std::max(at[2] - 1, 0); z <= std::min(at[2] + 1, lattice_.size[2] - 1); ++z) {
      for (int y = std::max(at[1] - 1, 0); y <= std::min(at[1] + 1, lattice_.size[1] - 1); ++y) {
        for (int x = std::max(at[0] - 1, 0); x <= std::min(at[0] + 1, lattice_.size[0] - 1); ++x) {
          look(x, y, z);
        }
      }
    }
    return best;
  }

  // Where what is left carries a vertex badly, its whole component is kept.
  void CarryVertices() {
    std::vector<std::uint8_t> whole(ComponentCount(), 0);
    bool all_well = true;
    for (const Vec3& vertex : surface_.vertices) {
      carrier_.push_back(Nearest(kept_, vertex));
      if (carrier_.back().least_weight >= -kFurthestOutside) continue;
      whole[component_[Nearest(candidate_, vertex).tetrahedron]] = 1;
      all_well = false;
    }
    if (all_well) return;
    KeepAllOf(whole);
    for (std::size_t v = 0; v < surface_.vertices.size(); ++v) {
      carrier_[v] = Nearest(kept_, surface_.vertices[v]);
    }
  }

  // How much of each kept tetrahedron is filled, such that the whole is what was inside.
  std::vector<double> Fills() const {
    double inside = 0, fixed = 0, adjustable = 0;  // in cells
    for (std::size_t e = 0; e < kept_.size(); ++e) {
      const double part = PartOf(static_cast<int>(e % 5));
      inside += part * Fill(e);
      if (!kept_[e]) continue;
      const bool partial = Fill(e) > kLeastFill && Fill(e) < 1;
      (partial ? adjustable : fixed) += part * std::max<double>(Fill(e), kLeastFill);
    }
    const double scale = adjustable > 0 ? std::clamp((inside - fixed) / adjustable, 0.5, 2.0) : 1.0;
    std::vector<double> fills;
    for (std::size_t e = 0; e < kept_.size(); ++e) {
      if (!kept_[e]) continue;
      const double fill = Fill(e) < 1 ? scale * Fill(e) : 1.0;
      fills.push_back(std::clamp(fill, kLeastFill, 1.0));
    }
    return fills;
  }

  // What most samples of each kept tetrahedron say; those without a word (in a cavity of the image,
  // or outside of it) take the label of the nearest that has one, face by face.
  std::vector<std::int32_t> Labels() const {
    std::vector<std::int32_t> label(kept_.size(), -1);
    std::vector<std::size_t> queue;
    for (std::size_t e = 0; e < kept_.size(); ++e) {
      label[e] = cells_[e / 5].label[e % 5];
      if (kept_[e] && label[e] >= 0) queue.push_back(e);
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
      ForEachNeighbour(queue[i], [&](std::size_t other) {
        if (!kept_[other] || label[other] >= 0) return;
        label[other] = label[queue[i]];
        queue.push_back(other);
      });
    }
    return label;
  }

  absl::StatusOr<TetMesh> Result() {
    std::vector<std::int32_t> number(lattice_.node_count(), -1);
    for (std::size_t e = 0; e < kept_.size(); ++e) {
      if (!kept_[e]) continue;
      for (const std::int32_t node : NodesOf(e)) number[node] = 0;
    }
    TetMesh mesh;
    mesh.surface = std::move(surface_);
    std::vector<Vec3>& nodes = mesh.surface.vertices;
    const std::size_t vertices = nodes.size();
    const std::size_t total = vertices + std::count(number.begin(), number.end(), 0);
    if (total > kMaxParticles) {
      return absl::InvalidArgumentError(absl::StrCat(
          "a lattice of ", lattice_.size[0], " x ", lattice_.size[1], " x ", lattice_.size[2],
          " cells has ", total - vertices, " nodes here, beside the surface's ", vertices,
          " vertices; at most ", kMaxParticles, " together are permitted"));
    }
    for (std::int32_t node = 0; node < lattice_.node_count(); ++node) {
      if (number[node] < 0) continue;
      number[node] = static_cast<std::int32_t>(nodes.size());
      nodes.push_back(lattice_.NodePosition(node));
    }
    const auto numbered = [&](std::array<std::int32_t, 4> corners) {
      for (std::int32_t& node : corners) node = number[node];
      return corners;
    };
    const std::vector<std::int32_t> label = Labels();
    for (std::size_t e = 0; e < kept_.size(); ++e) {
      if (!kept_[e]) continue;
      mesh.tetrahedra.push_back(numbered(NodesOf(e)));
      mesh.label.push_back(label[e]);
    }
    mesh.fill = Fills();
    mesh.group.assign(mesh.tetrahedra.size(), -1);
    for (std::size_t v = 0; v < vertices; ++v) {
      mesh.carried.push_back({static_cast<std::int32_t>(v),
                              numbered(NodesOf(carrier_[v].tetrahedron)), carrier_[v].weights});
    }
    return mesh;
  }

  Lattice lattice_;
  std::vector<FilledCell> cells_;
  TriangleMesh surface_;
  std::vector<std::int32_t> slot_of_;    // [#cells of the lattice] into cells_; -1: outside
  std::vector<std::uint8_t> candidate_;  // [5 * #cells_] touched by the surface or partly inside
  std::vector<std::uint8_t> kept_;
  std::vector<std::int32_t> component_;  // of candidates
  std::vector<Carrier> carrier_;         // [#vertices]
};

}  // namespace

absl::StatusOr<TetMesh> EmbedInLattice(const TriangleMesh& surface, int cells,
                                       const LabelAt& label_at) {
  const MeshCheck check = CheckMesh(surface);
  const MeshReport& report = check.report;
  if (report.triangles == 0 || report.bad_numbers > 0 || report.bad_indices > 0) {
    return absl::InvalidArgumentError(check.flaws[0].message);
  }
  TriangleMesh clean = CleanSurface(surface);
  const auto nothing = absl::InvalidArgumentError(
      "the surface encloses nothing: its generalised winding number is nowhere above 1/2");
  if (clean.triangles.empty()) return nothing;
  const WindingNumber winding(clean);
  if (!FaceOutward(winding, &clean)) return nothing;
  const Lattice lattice = LatticeAround(clean, cells);
  int samples_along = 0;
  std::vector<FilledCell> filled = FillCells(lattice, clean, winding, label_at, &samples_along);
  // Every cell has eight nodes, each shared by at most eight cells: there are no fewer nodes.
  if (filled.size() > kMaxParticles) {
    return absl::InvalidArgumentError(
        absl::StrCat(cells, " cells along the longest extent make a lattice of ", lattice.size[0],
                     " x ", lattice.size[1], " x ", lattice.size[2], " cells, ", filled.size(),
                     " of them in use; at most ", kMaxParticles, " nodes are permitted"));
  }
  absl::StatusOr<TetMesh> mesh = Embedder(lattice, std::move(filled), std::move(clean)).Run();
  if (!mesh.ok()) return mesh;
  const double enclosed_m3 = report.closed && report.oriented ? std::abs(report.volume_m3) : 0;
  const double filled_m3 = FilledVolume(*mesh);
  if (enclosed_m3 > 0 && std::abs(filled_m3 / enclosed_m3 - 1) > kMostVolumeError) {
    mesh->warnings.push_back(
        absl::StrCat("the tetrahedra hold ", filled_m3, " m^3, the surface encloses ", enclosed_m3,
                     " m^3: it overlaps itself, or is thin for ", cells, " cells (samples are ",
                     lattice.cell_m / samples_along, " m apart)"));
  }
  for (const MeshFlaw& flaw : check.flaws) {
    mesh->warnings.push_back(flaw.warning ? flaw.message
                                          : flaw.message + " (the lattice carries it as it is)");
  }
  return mesh;
}

}  // namespace adhesim
