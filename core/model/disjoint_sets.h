#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace adhesim {

// Which of n things belong together (union by lower number, with path halving). The root of a set
// is its lowest member, so that nothing depends on the order of unions. Allocates when it is made,
// never after.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count = 0) : parent_(count) { Reset(); }
  std::size_t size() const { return parent_.size(); }
  // Each by itself again.
  void Reset() { std::iota(parent_.begin(), parent_.end(), 0); }

  int Root(int member) {
    while (parent_[member] != member) member = parent_[member] = parent_[parent_[member]];
    return member;
  }

  // The roots of two that are one from now on.
  struct Union {
    int root, former;  // the same when they were one already
  };
  Union Unite(int a, int b) {
    a = Root(a);
    b = Root(b);
    if (b < a) std::swap(a, b);
    parent_[b] = a;
    return {a, b};
  }

 private:
  std::vector<std::int32_t> parent_;  // [size()]
};

}  // namespace adhesim
