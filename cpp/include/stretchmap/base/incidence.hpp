// What meets each of n things: the tets round a vertex, the edges round it, the boxes in a cell.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap {

// \tparam Item what is listed. \tparam Offset counts all items together.
template <class Item = Index, class Offset = Index>
class Incidence {
 public:
  Incidence() = default;

  // A counting sort. enumerate(visit) has to call visit(thing, item) for every pair, the same ones
  // both times it is called; things are below n, and the items of each keep this order.
  template <class Enumerate>
  Incidence(Index n, const Enumerate& enumerate) : start_(static_cast<std::size_t>(n) + 1, 0) {
    enumerate([&](Index thing, const Item&) { ++start_[static_cast<std::size_t>(thing) + 1]; });
    for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
    items_.resize(static_cast<std::size_t>(start_.back()));
    std::vector<Offset> next(start_.begin(), start_.end() - 1);
    enumerate([&](Index thing, const Item& item) { items_[next[thing]++] = item; });
  }

  // The same in parts, which threads share: enumerate(part, visit) visits the pairs of part 0, 1,
  // ...
  template <class Enumerate>
  Incidence(Index n, Index parts, const Enumerate& enumerate)
      : start_(static_cast<std::size_t>(n) + 1) {
    const auto things = static_cast<std::size_t>(n);
    Buffer<Offset> next(things * static_cast<std::size_t>(parts));
    for_tasks(parts, [&](Index part) {
      Offset* count = next.data() + things * static_cast<std::size_t>(part);
      std::fill_n(count, things, Offset{0});
      enumerate(part, [&](Index thing, const Item&) { ++count[thing]; });
    });
    const Offset total = number(n, next);
    items_.resize(static_cast<std::size_t>(total));
    for_tasks(parts, [&](Index part) {
      Offset* to = next.data() + things * static_cast<std::size_t>(part);
      enumerate(part, [&](Index thing, const Item& item) { items_[to[thing]++] = item; });
    });
  }

  struct Range {
    const Item *first, *last;
    const Item* begin() const { return first; }
    const Item* end() const { return last; }
  };
  Index size() const { return static_cast<Index>(start_.size()) - 1; }
  Range operator[](Index thing) const { return of(thing, thing + 1); }
  // Of all things in [first, last).
  Range of(Index first, Index last) const {
    return {items_.data() + start_[first], items_.data() + start_[last]};
  }

 private:
  // Where the items of each thing start, from how many each part has of it; `next` becomes where
  // those of each part start. Returns their number.
  Offset number(Index n, Buffer<Offset>& next) {
    std::vector<Offset> before(static_cast<std::size_t>(chunk_count(n)) + 1, 0);
    const auto of_all_parts = [&](Index thing, const auto& visit) {
      for (std::size_t at = thing; at < next.size(); at += static_cast<std::size_t>(n))
        visit(next[at]);
    };
    for_chunks(n, [&](Index begin, Index end) {
      Offset& sum = before[begin / kChunk + 1];
      for (Index i = begin; i < end; ++i) of_all_parts(i, [&](Offset count) { sum += count; });
    });
    for (std::size_t c = 1; c < before.size(); ++c) before[c] += before[c - 1];
    for_chunks(n, [&](Index begin, Index end) {
      Offset total = before[begin / kChunk];
      for (Index i = begin; i < end; ++i) {
        start_[i] = total;
        of_all_parts(i, [&](Offset& count) { total += std::exchange(count, total); });
      }
    });
    return start_[n] = before.back();
  }

  Buffer<Offset> start_;  // (n + 1)
  Buffer<Item> items_;
};

// (n) what m elements have at each of n things, in their order: each(element, visit) calls
// visit(thing, item), the same ones both times it is called.
template <class Item = Index, class Each>
Incidence<Item> listed_at(Index n, Index m, const Each& each) {
  constexpr Index kLeast = 16384, kMost = 8;  // elements of a part, parts
  const Index parts = std::clamp(chunk_count(m, kLeast), Index{1}, kMost);
  const Index size = chunk_count(m, parts);
  return Incidence<Item>(n, parts, [&](Index part, const auto& visit) {
    for (Index e = part * size; e < std::min(m, (part + 1) * size); ++e) each(e, visit);
  });
}

// (n) the corners at each vertex, as width * element + corner of the rows of `elements` (m, width),
// ascending; entries for which row_of(vertex) is negative are in none.
template <class Elements, class RowOf>
Incidence<> corners_at(const Elements& elements, Index n, const RowOf& row_of) {
  const Index m = static_cast<Index>(elements.rows()), width = static_cast<Index>(elements.cols());
  return listed_at(n, m, [&](Index e, const auto& visit) {
    for (Index k = 0; k < width; ++k)
      if (const Index row = row_of(elements(e, k)); row >= 0) visit(row, width * e + k);
  });
}
template <class Elements>
Incidence<> corners_at(const Elements& elements, Index n) {
  return corners_at(elements, n, [](Index vertex) { return vertex; });
}

}  // namespace stretchmap
