#pragma once

#include <span>
#include <vector>

#include "core/model/model.h"

namespace adhesim {

// A tree of boxes over the triangles of one body. Its shape is chosen once, from the body at rest;
// Refit() follows the deformation. A query visits triangles in a fixed order.
class TriangleTree {
 public:
  TriangleTree(const Model& model, const Body& body);

  // Boxes around the triangles now, `margin_m` larger on every side. Allocates nothing.
  void Refit(std::span<const Vec3> position_m, double margin_m);
  // The box around everything, margin included.
  const Aabb& bounds() const { return nodes_[0].box; }

  // Calls visit(triangle) for every triangle whose box overlaps `box`.
  template <typename Visit>
  void Query(const Aabb& box, const Visit& visit) const {
    int stack[kMaxDepth];
    int size = 0;
    stack[size++] = 0;
    while (size > 0) {
      const Node& node = nodes_[stack[--size]];
      if (!node.box.Overlaps(box)) continue;
      if (node.count > 0) {
        for (int k = 0; k < node.count; ++k) {
          if (triangle_box_[node.first + k].Overlaps(box)) visit(triangle_[node.first + k]);
        }
      } else {
        stack[size++] = node.right;
        stack[size++] = node.left;
      }
    }
  }

 private:
  static constexpr int kMaxDepth = 64;  // median splits: depth is log2 of the triangle count
  static constexpr int kLeafSize = 4;
  struct Node {
    Aabb box;
    int left = -1, right = -1;  // children, after their parent
    int first = 0, count = 0;   // triangles of a leaf
  };
  int Build(int first, int count, std::vector<Vec3>* centre);

  const Model& model_;
  std::vector<Node> nodes_;
  std::vector<int> triangle_;       // [#triangles of the body] leaf by leaf
  std::vector<Aabb> triangle_box_;  // the same order
};

}  // namespace adhesim
