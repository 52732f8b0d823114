#include "linalg/direct/nested_dissection.hpp"

#include <algorithm>
#include <numeric>

namespace stretchmap::linalg {

namespace {

constexpr Index kLeaf = 32;  // pieces up to this size are not divided

class Dissector {
 public:
  Dissector(Index n, const Index* start, const Index* col)
      : start_(start), col_(col), items_(n), piece_(n, 0), near_(n), far_(n), mark_(n, -1) {
    std::iota(items_.begin(), items_.end(), 0);
    result_.order.reserve(n);
  }

  Dissection run() {
    divide(0, static_cast<Index>(items_.size()));
    return std::move(result_);
  }

 private:
  // The piece items_[first .. last) becomes a subtree; \return its root.
  Index divide(Index first, Index last) {
    Dissection::Node node;
    Index own = first;  // the separator goes to items_[first .. own)
    if (last - first > kLeaf) {
      const Index label = ++labels_;
      for (Index i = first; i < last; ++i) piece_[items_[i]] = label;
      Index middle = first;
      own = separate(first, last, label, middle);
      if (own < middle) node.children.push_back(divide(own, middle));
      if (std::max(own, middle) < last) node.children.push_back(divide(middle, last));
    } else {
      own = last;
    }
    node.first = static_cast<Index>(result_.order.size());
    result_.order.insert(result_.order.end(), items_.begin() + first, items_.begin() + own);
    node.last = static_cast<Index>(result_.order.size());
    result_.nodes.push_back(std::move(node));
    return static_cast<Index>(result_.nodes.size()) - 1;
  }

  // Reorders the piece: separator, one half from the returned index on, the other from `middle` on.
  Index separate(Index first, Index last, Index label, Index& middle) {
    const Index size = last - first;
    search(items_[first], label, near_);
    if (static_cast<Index>(queue_.size()) < size) {  // several components: nothing to remove
      for (const Index v : queue_) piece_[v] = -1;
      middle = partition(first, last, [&](Index v) { return piece_[v] == -1; });
      return first;
    }
    // Two ends far apart; the curve equally far from both is straighter than a front round one.
    const Index end = queue_.back();
    search(end, label, near_);
    search(queue_.back(), label, far_);
    const auto key = [&](Index v) { return near_[v] - far_[v]; };
    std::vector<Index> keys(size);
    for (Index i = 0; i < size; ++i) keys[i] = key(items_[first + i]);
    std::nth_element(keys.begin(), keys.begin() + size / 2, keys.end());
    const Index cut = keys[size / 2];
    middle = partition(first, last, [&](Index v) { return key(v) < cut; });
    if (middle == first) middle = partition(first, last, [&](Index v) { return key(v) <= cut; });
    if (middle == last) return last;  // no vertex farther than another: not to be divided
    return thinner_border(first, middle, last, label);
  }

  // Breadth first from `root` inside a piece: distances, and the vertices in queue_.
  void search(Index root, Index label, std::vector<Index>& distance) {
    ++searches_;
    queue_.assign(1, root);
    mark_[root] = searches_;
    distance[root] = 0;
    for (std::size_t next = 0; next < queue_.size(); ++next) {
      const Index v = queue_[next];
      for (Index e = start_[v]; e < start_[v + 1]; ++e) {
        const Index w = col_[e];
        if (piece_[w] != label || mark_[w] == searches_) continue;
        mark_[w] = searches_;
        distance[w] = distance[v] + 1;
        queue_.push_back(w);
      }
    }
  }

  // Halves [first, middle) and [middle, last): the vertices of one with neighbors in the other, of
  // whichever has fewer, go to the front.
  Index thinner_border(Index first, Index& middle, Index last, Index label) {
    const Index other = ++labels_;
    for (Index i = middle; i < last; ++i) piece_[items_[i]] = other;
    const auto border = [&](Index v, Index opposite) {
      return std::any_of(col_ + start_[v], col_ + start_[v + 1],
                         [&](Index w) { return piece_[w] == opposite; });
    };
    const auto in_first = [&](Index v) { return border(v, other); };
    const auto in_second = [&](Index v) { return border(v, label); };
    const auto items = items_.begin();
    if (std::count_if(items + first, items + middle, in_first) <=
        std::count_if(items + middle, items + last, in_second))
      return partition(first, middle, in_first);
    const Index own = partition(middle, last, in_second) - middle;
    // Separator before the first half instead of behind it.
    std::rotate(items + first, items + middle, items + middle + own);
    middle += own;
    return first + own;
  }

  // Those with the property first, order kept; \return where the others begin.
  template <class Property>
  Index partition(Index first, Index last, const Property& property) {
    const auto items = items_.begin();
    return static_cast<Index>(std::stable_partition(items + first, items + last, property) - items);
  }

  const Index* start_;
  const Index* col_;
  std::vector<Index> items_, piece_, near_, far_, mark_, queue_;
  Index labels_ = 0, searches_ = -1;
  Dissection result_;
};

}  // namespace

Dissection dissect(Index n, const Index* start, const Index* col) {
  return Dissector(n, start, col).run();
}

}  // namespace stretchmap::linalg
