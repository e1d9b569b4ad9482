#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace adhesim {

// A list's place in a ListStore.
struct ListSpan {
  std::int32_t first = 0, count = 0;
};

// Many lists of one kind in one array, each written at once and replaced as a whole. A new list
// goes to the end; what nobody refers to any more is left behind and goes away when the living
// lists are copied together. That costs no more than writing them did, because it is not done
// before as much was written as is alive. Allocates at construction only.
template <typename Item>
class ListStore {
 public:
  explicit ListStore(std::size_t capacity) {
    items_.reserve(capacity);
    spare_.reserve(capacity);
  }

  // What is pushed from now on is the list that End() gives.
  void Begin() { begun_ = items_.size(); }
  // False: there is no room.
  bool Push(const Item& item) {
    if (items_.size() == items_.capacity()) return false;
    items_.push_back(item);
    return true;
  }
  ListSpan End() const {
    return {static_cast<std::int32_t>(begun_), static_cast<std::int32_t>(items_.size() - begun_)};
  }

  std::span<Item> operator[](const ListSpan& list) {
    return std::span(items_).subspan(list.first, list.count);
  }
  std::span<const Item> operator[](const ListSpan& list) const {
    return std::span(items_).subspan(list.first, list.count);
  }
  const Item& at(std::int32_t index) const { return items_[index]; }

  // Time to copy: BeginCopy, Keep for every living list, EndCopy.
  bool crowded() const { return items_.size() > limit_; }
  void BeginCopy() { spare_.clear(); }
  void Keep(ListSpan* list) {
    const auto from = items_.begin() + list->first;
    list->first = static_cast<std::int32_t>(spare_.size());
    spare_.insert(spare_.end(), from, from + list->count);
  }
  void EndCopy() {
    items_.swap(spare_);
    limit_ = 2 * items_.size() + kLeast;
  }

 private:
  static constexpr std::size_t kLeast = 4096;
  std::vector<Item> items_, spare_;
  std::size_t begun_ = 0;
  std::size_t limit_ = kLeast;
};

// A distance as a number of half the size that is no larger.
inline float NoMoreThan(double distance_m) {
  return static_cast<float>(distance_m) * (1 - 1e-6f);  // a float is within 6e-8
}

}  // namespace adhesim
