#pragma once

#include <span>
#include <vector>

#include "core/model/model.h"

namespace adhesim {

// A tree of boxes over the triangles of one body. Refit() follows the deformation: boxes are
// renewed, and where they have come to overlap too much for that, as those of a sheet that was
// rolled up, so is the tree (median splits of what it is now). A query visits triangles in an order
// that follows from the tree alone.
class TriangleTree {
 public:
  TriangleTree(const Model& model, const Body& body);

  // Boxes around the triangles as they are now. Allocates nothing.
  void Refit(std::span<const Vec3> position_m);
  // The box around everything.
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
  // A tree whose cost has become so many times what it was is built anew.
  static constexpr double kWorse = 2;
  void BuildFrom(std::span<const Vec3> position_m);
  int Build(int first, int count);
  void RefitBoxes(std::span<const Vec3> position_m);
  // The areas of the nodes' boxes over those of the triangles' own: how many nodes a small query
  // meets for each triangle.
  double Cost() const;

  const Model& model_;
  int first_triangle_;
  double best_cost_;  // since it was built
  std::vector<Node> nodes_;
  std::vector<int> triangle_;       // [#triangles of the body] leaf by leaf
  std::vector<Aabb> triangle_box_;  // the same order
  std::vector<Vec3> centre_;  // [#triangles of the body] in their own order, when it was built
};

}  // namespace adhesim
