// Separators: that they separate, and that they lie where a graph is thin.
#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "linalg/direct/nested_dissection.hpp"

TEST_SUITE_BEGIN("linalg");

namespace {

using namespace stretchmap;

struct Graph {
  explicit Graph(Index n) : rows(n) {}
  void join(Index i, Index j) {
    rows[i].push_back(j);
    rows[j].push_back(i);
  }
  // Vertices first, first + 1, ... as a grid, row by row.
  void add_grid(Index first, Index height, Index width) {
    for (Index r = 0; r < height; ++r)
      for (Index c = 0; c < width; ++c) {
        const Index v = first + r * width + c;
        if (c + 1 < width) join(v, v + 1);
        if (r + 1 < height) join(v, v + width);
      }
  }
  linalg::Dissection dissected() const {
    std::vector<Index> start{0}, col;
    for (const std::vector<Index>& row : rows) {
      col.insert(col.end(), row.begin(), row.end());
      start.push_back(static_cast<Index>(col.size()));
    }
    return linalg::dissect(static_cast<Index>(rows.size()), start.data(), col.data());
  }
  std::vector<std::vector<Index>> rows;
};

// First place of the subtree of a node.
Index begin_of(const linalg::Dissection& found, Index node) {
  Index first = found.nodes[node].first;
  for (const Index child : found.nodes[node].children)
    first = std::min(first, begin_of(found, child));
  return first;
}

}  // namespace

TEST_CASE("no edge joins the two sides of a separator") {
  Graph graph(30 * 40);
  graph.add_grid(0, 30, 40);
  const linalg::Dissection found = graph.dissected();
  std::vector<Index> place(graph.rows.size());
  for (std::size_t k = 0; k < found.order.size(); ++k) place[found.order[k]] = Index(k);
  CHECK(found.order.size() == graph.rows.size());
  int separated = 0;
  for (std::size_t n = 0; n < found.nodes.size(); ++n) {
    const std::vector<Index>& children = found.nodes[n].children;
    if (children.size() < 2) continue;
    ++separated;
    const Index first = begin_of(found, children[0]), middle = begin_of(found, children[1]);
    for (Index k = first; k < middle; ++k)
      for (const Index w : graph.rows[found.order[k]])
        CHECK_FALSE((place[w] >= middle && place[w] < found.nodes[n].first));
  }
  CHECK(separated > 10);
}

TEST_CASE("a graph is cut where it is thin, not in the middle") {
  // Two grids, one of them half as large again, joined by a bridge of three edges.
  const Index width = 20, small = 20 * width, large = 30 * width;
  Graph graph(small + large);
  graph.add_grid(0, 20, width);
  graph.add_grid(small, 30, width);
  for (Index c = 0; c < 3; ++c) graph.join(small - width + c, small + c);
  const linalg::Dissection found = graph.dissected();
  CHECK(found.nodes.back().last - found.nodes.back().first <= 3);
}

TEST_SUITE_END();
