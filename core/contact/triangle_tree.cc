#include "core/contact/triangle_tree.h"

#include <algorithm>
#include <numeric>

namespace adhesim {

TriangleTree::TriangleTree(const Model& model, const Body& body)
    : model_(model), first_triangle_(body.first_triangle) {
  triangle_.resize(body.triangle_count);
  triangle_box_.resize(body.triangle_count);
  centre_.resize(body.triangle_count);
  BuildFrom(model.rest_position_m);
}

void TriangleTree::BuildFrom(std::span<const Vec3> position_m) {
  for (std::size_t k = 0; k < centre_.size(); ++k) {
    const Triangle& tri = model_.triangles[first_triangle_ + k];
    centre_[k] = (position_m[tri[0]] + position_m[tri[1]] + position_m[tri[2]]) / 3;
  }
  std::iota(triangle_.begin(), triangle_.end(), first_triangle_);
  nodes_.clear();  // as many as before: their number follows from that of the triangles
  Build(0, static_cast<int>(triangle_.size()));
  RefitBoxes(position_m);
  best_cost_ = Cost();
}

int TriangleTree::Build(int first, int count) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  if (count <= kLeafSize) {
    nodes_[index].first = first;
    nodes_[index].count = count;
    return index;
  }
  const auto centre = [&](int t) -> const Vec3& { return centre_[t - first_triangle_]; };
  Aabb spread;
  for (int k = first; k < first + count; ++k) spread.Add(centre(triangle_[k]));
  int axis;
  (spread.max - spread.min).maxCoeff(&axis);
  const int half = count / 2;
  std::nth_element(triangle_.begin() + first, triangle_.begin() + first + half,
                   triangle_.begin() + first + count, [&](int s, int t) {
                     const double cs = centre(s)(axis), ct = centre(t)(axis);
                     return cs != ct ? cs < ct : s < t;
                   });
  const int left = Build(first, half);
  const int right = Build(first + half, count - half);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

void TriangleTree::Refit(std::span<const Vec3> position_m) {
  RefitBoxes(position_m);
  const double cost = Cost();
  best_cost_ = std::min(best_cost_, cost);
  if (cost > kWorse * best_cost_) BuildFrom(position_m);
}

double TriangleTree::Cost() const {
  const auto area = [](const Aabb& box) {
    const Vec3 side = box.max - box.min;
    return side.x() * side.y() + side.y() * side.z() + side.z() * side.x();
  };
  double nodes = 0, triangles = 0;
  for (const Node& node : nodes_) nodes += area(node.box);
  for (const Aabb& box : triangle_box_) triangles += area(box);
  return triangles > 0 ? nodes / triangles : 0;
}

void TriangleTree::RefitBoxes(std::span<const Vec3> position_m) {
  for (std::size_t k = 0; k < triangle_.size(); ++k) {
    Aabb& box = triangle_box_[k] = Aabb{};
    for (int p : model_.triangles[triangle_[k]]) box.Add(position_m[p]);
  }
  for (int n = static_cast<int>(nodes_.size()) - 1; n >= 0; --n) {
    Node& node = nodes_[n];
    node.box = Aabb{};
    if (node.count > 0) {
      for (int k = 0; k < node.count; ++k) node.box.Add(triangle_box_[node.first + k]);
    } else {
      node.box.Add(nodes_[node.left].box);
      node.box.Add(nodes_[node.right].box);
    }
  }
}

}  // namespace adhesim
