#include "linalg/direct/nested_dissection.hpp"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <utility>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::linalg {

namespace {

constexpr Index kLeaf = 32;       // pieces up to this size are not divided
constexpr double kSmaller = 0.3;  // share of a piece that either half has, where one can cut so
constexpr Index kAlone = 1024;    // pieces of so many vertices at least are worth a thread,
constexpr Index kShares = 8;      // and so are those of this share of all

class Dissector {
 public:
  // A piece whose subtree is left to others: a node that stands for it, and its vertices.
  struct Left {
    Index node;
    std::vector<Index> vertices;
  };

  // Pieces of at most `leave` vertices are left.
  Dissector(Index n, const Index* start, const Index* col, Index leave)
      : start_(start),
        col_(col),
        leave_(leave),
        items_(n),
        piece_(n, 0),
        near_(n),
        far_(n),
        mark_(n, -1) {
    std::iota(items_.begin(), items_.end(), 0);
    result_.order.reserve(n);
  }

  Dissection run() {
    divide(0, static_cast<Index>(items_.size()));
    return std::move(result_);
  }
  const std::vector<Left>& left() const { return left_; }

 private:
  // The piece items_[first .. last) becomes a subtree; \return its root.
  Index divide(Index first, Index last) {
    Dissection::Node node;
    Index own = first;  // the separator goes to items_[first .. own)
    if (last - first <= leave_) {
      own = last;
      left_.push_back({static_cast<Index>(result_.nodes.size()),
                       {items_.begin() + first, items_.begin() + last}});
    } else if (last - first > kLeaf) {
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
    if (static_cast<Index>(queue_.size()) < size) {  // nothing to remove
      middle = share_components(first, last, label);
      return first;
    }
    // Two ends far apart; curves along which the distances from them differ by as much are
    // straighter than fronts round one.
    const Index end = queue_.back();
    search(end, label, near_);
    search(queue_.back(), label, far_);
    const Index cut = thinnest_cut(first, last, label);
    middle = partition(first, last, [&](Index v) { return key(v) < cut; });
    if (middle == last) return last;  // no vertex farther than another: not to be divided
    return thinner_border(first, middle, last, label);
  }

  // Of a piece of several components, the first ones up to a half of its vertices, but at least
  // one, go to the front; \return where the others begin. The first has been searched.
  Index share_components(Index first, Index last, Index label) {
    Index taken = 0;
    for (Index next = first;;) {
      for (const Index v : queue_) piece_[v] = -1;
      taken += static_cast<Index>(queue_.size());
      while (next < last && piece_[items_[next]] == -1) ++next;
      search(items_[next], label, near_);
      if (2 * (taken + static_cast<Index>(queue_.size())) > last - first) break;
    }
    return partition(first, last, [&](Index v) { return piece_[v] == -1; });
  }

  Index key(Index v) const { return near_[v] - far_[v]; }

  // The least key of a second half such that the fewest vertices separate it from the first.
  Index thinnest_cut(Index first, Index last, Index label) const {
    const Index size = last - first;
    const auto [low, high] = std::minmax_element(items_.begin() + first, items_.begin() + last,
                                                 [&](Index v, Index w) { return key(v) < key(w); });
    const Index least = key(*low), cuts = key(*high) - least;
    // What cut c adds to cut c - 1: vertices before it; and those before and behind next to it.
    std::vector<Index> before(cuts + 2, 0), inner(cuts + 2, 0), outer(cuts + 2, 0);
    for (Index i = first; i < last; ++i) {
      const Index v = items_[i], own = key(v) - least;
      Index lowest = own, highest = own;
      for (Index e = start_[v]; e < start_[v + 1]; ++e) {
        if (piece_[col_[e]] != label) continue;
        lowest = std::min(lowest, key(col_[e]) - least);
        highest = std::max(highest, key(col_[e]) - least);
      }
      ++before[own + 1];
      ++inner[own + 1];
      --inner[highest + 1];
      ++outer[lowest + 1];
      --outer[own + 1];
    }
    Index best = 1, fewest = size + 1, nearest = size;
    Index smaller = 0, within = 0, beyond = 0;
    for (Index c = 1; c <= cuts; ++c) {
      smaller += before[c];
      within += inner[c];
      beyond += outer[c];
      const bool fair = std::min(smaller, size - smaller) >= kSmaller * size;
      const Index thin = fair ? std::min(within, beyond) : size;
      const Index off = std::abs(2 * smaller - size);
      if (std::pair(thin, off) >= std::pair(fewest, nearest)) continue;
      best = c;
      fewest = thin;
      nearest = off;
    }
    return least + best;
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
  Index leave_;
  std::vector<Left> left_;
  std::vector<Index> items_, piece_, near_, far_, mark_, queue_;
  Index labels_ = 0, searches_ = -1;
  Dissection result_;
};

// One piece by itself, its vertices numbered in its order. place[v] is that number, piece[v] whose
// it is.
Dissection dissect_piece(const std::vector<Index>& vertices, Index own, const Buffer<Index>& piece,
                         const Buffer<Index>& place, const Index* start, const Index* col) {
  std::vector<Index> inner_start{0}, inner;
  inner_start.reserve(vertices.size() + 1);
  for (const Index v : vertices) {
    for (Index e = start[v]; e < start[v + 1]; ++e)
      if (piece[col[e]] == own) inner.push_back(place[col[e]]);
    inner_start.push_back(static_cast<Index>(inner.size()));
  }
  const auto n = static_cast<Index>(vertices.size());
  Dissection found = Dissector(n, inner_start.data(), inner.data(), 0).run();
  for (Index& v : found.order) v = vertices[v];
  return found;
}

// The subtrees in place of the nodes that stand for them.
Dissection grafted(const Dissection& top, const std::vector<Dissector::Left>& left,
                   const std::vector<Dissection>& subtrees) {
  Dissection all;
  all.order = top.order;
  std::vector<Index> now;  // of each node of the top
  std::size_t k = 0;
  for (Index i = 0; i < static_cast<Index>(top.nodes.size()); ++i) {
    Dissection::Node node = top.nodes[i];
    if (k < left.size() && left[k].node == i) {
      const Dissection& subtree = subtrees[k++];
      std::copy(subtree.order.begin(), subtree.order.end(), all.order.begin() + node.first);
      const auto before = static_cast<Index>(all.nodes.size());
      for (Dissection::Node inner : subtree.nodes) {
        inner.first += node.first;
        inner.last += node.first;
        for (Index& child : inner.children) child += before;
        all.nodes.push_back(std::move(inner));
      }
    } else {
      for (Index& child : node.children) child = now[child];
      all.nodes.push_back(std::move(node));
    }
    now.push_back(static_cast<Index>(all.nodes.size()) - 1);
  }
  return all;
}

}  // namespace

Dissection dissect(Index n, const Index* start, const Index* col) {
  Dissector dissector(n, start, col, n > 2 * kAlone ? std::max(kAlone, n / kShares) : 0);
  const Dissection top = dissector.run();
  const std::vector<Dissector::Left>& left = dissector.left();
  if (left.empty()) return top;
  Buffer<Index> piece(n), place(n);
  for_rows(n, [&](Index v) { piece[v] = -1; });
  const auto count = static_cast<Index>(left.size());
  for_tasks(count, [&](Index k) {
    for (std::size_t i = 0; i < left[k].vertices.size(); ++i) {
      piece[left[k].vertices[i]] = k;
      place[left[k].vertices[i]] = static_cast<Index>(i);
    }
  });
  std::vector<Dissection> subtrees(left.size());
  for_tasks(count, [&](Index k) {
    subtrees[k] = dissect_piece(left[k].vertices, k, piece, place, start, col);
  });
  return grafted(top, left, subtrees);
}

}  // namespace stretchmap::linalg
