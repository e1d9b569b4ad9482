#include "core/contact/triangle_tree.h"

#include <algorithm>
#include <numeric>

namespace adhesim {

TriangleTree::TriangleTree(const Model& model, const Body& body) : model_(model) {
  std::vector<Vec3> centre(model.triangles.size());
  for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
    const Triangle& tri = model.triangles[t];
    centre[t] = (model.rest_position_m[tri[0]] + model.rest_position_m[tri[1]] +
                 model.rest_position_m[tri[2]]) /
                3;
  }
  triangle_.resize(body.triangle_count);
  std::iota(triangle_.begin(), triangle_.end(), body.first_triangle);
  triangle_box_.resize(body.triangle_count);
  Build(0, body.triangle_count, &centre);
  Refit(model.rest_position_m, 0);
}

int TriangleTree::Build(int first, int count, std::vector<Vec3>* centre) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  if (count <= kLeafSize) {
    nodes_[index].first = first;
    nodes_[index].count = count;
    return index;
  }
  Aabb spread;
  for (int k = first; k < first + count; ++k) spread.Add((*centre)[triangle_[k]]);
  int axis;
  (spread.max - spread.min).maxCoeff(&axis);
  const int half = count / 2;
  std::nth_element(triangle_.begin() + first, triangle_.begin() + first + half,
                   triangle_.begin() + first + count, [&](int s, int t) {
                     const double cs = (*centre)[s](axis), ct = (*centre)[t](axis);
                     return cs != ct ? cs < ct : s < t;
                   });
  const int left = Build(first, half, centre);
  const int right = Build(first + half, count - half, centre);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

void TriangleTree::Refit(std::span<const Vec3> position_m, double margin_m) {
  for (std::size_t k = 0; k < triangle_.size(); ++k) {
    Aabb box;
    for (int p : model_.triangles[triangle_[k]]) box.Add(position_m[p]);
    triangle_box_[k] = box.Grown(margin_m);
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
