#include "linalg/ordering.hpp"

#include <cstddef>

namespace stretchmap::linalg {
namespace {

// Appends the component of `root` to `order` and marks it.
void visit(Index root, const Index* start, const Index* col, char mark, std::vector<char>& marks,
           std::vector<Index>& order) {
  std::size_t next = order.size();
  order.push_back(root);
  marks[root] = mark;
  for (; next < order.size(); ++next) {
    const Index i = order[next];
    for (Index e = start[i]; e < start[i + 1]; ++e) {
      if (marks[col[e]] == mark) continue;
      marks[col[e]] = mark;
      order.push_back(col[e]);
    }
  }
}

}  // namespace

std::vector<Index> breadth_first_order(Index n, const Index* start, const Index* col) {
  std::vector<char> marks(static_cast<std::size_t>(n), 0);
  std::vector<Index> order;
  order.reserve(static_cast<std::size_t>(n));
  for (Index root = 0; root < n; ++root) {
    if (marks[root]) continue;
    // The vertex reached last is far out; a second search from there has the narrower fronts.
    const std::size_t first = order.size();
    visit(root, start, col, 1, marks, order);
    const Index end = order.back();
    order.resize(first);
    visit(end, start, col, 2, marks, order);
  }
  return order;
}

}  // namespace stretchmap::linalg
